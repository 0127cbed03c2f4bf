#include "nodes/cd_node/detector.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/cd_node/hit_writer.hpp"
#include "nodes/cd_node/pair_objects.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::MessageType;
using telemetry::SpanTimer;

Detector::Detector(NodeState& state)
    : state_(state),
      sweep_(state.setup.placement == Placement::region ? state.setup.objects : 0,
             state.setup.placement == Placement::region ? state.setup.pairs : 0, state.setup.layer_masks,
             state.setup.keep_resting),
      narrow_(*state.setup.shapes) {
  pairs_.reserve(pairs_per_test);
  kinds_.reserve(shape_kinds * shape_kinds);
  hits_.reserve(state.setup.objects);
  touches_.reserve_rarely_used(state.setup.objects);
  touches_.request_huge_pages(state.setup.objects / 2);  // usually there are not more contacts
  order_.reserve(state.setup.objects);
  narrow_.remember_axes(state.setup.remember_axes, state.setup.objects);
}

// The words of pairs that the sweep keeps refer to the hits of the last frame. Without such pairs these are not read.
void Detector::begin() {
  if (!sweep_.kept_words().empty()) {
    std::swap(hits_, last_hits_);
    std::swap(touches_, last_touches_);
  }
  knows_last_frame_ = std::exchange(has_swept_, false);
  clear();
}

void Detector::discard() {
  knows_last_frame_ = has_swept_ = false;
  clear();
}

void Detector::clear() {
  pairs_.clear();
  kept_of_batch_.clear();
  hits_.clear();
  touches_.clear();
  order_.clear();
  candidates_ = carried_ = 0;
  narrow_.reset_counters();
}

void Detector::receive_pairs(const messages::MessageView& message) {
  const auto bodies = state_.objects.bodies();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& pair = message.view<messages::PairRecord>(i);
    const geometry::CandidatePair known{state_.objects.find(pair.a), state_.objects.find(pair.b)};
    assert(known.a != RegionObjects::none && known.b != RegionObjects::none);
    base::prefetch_for_read(&bodies[known.a]);
    base::prefetch_for_read(&bodies[known.b]);
    pairs_.push_back(known);
    if (pairs_.size() == pairs_per_test) {
      test_pairs();
    }
  }
  state_.received.pairs |= message.last();
}

void Detector::test_all() {
  if (state_.setup.placement == Placement::region) {
    sweep();
  } else {
    test_pairs();
  }
}

void Detector::finish() {
  count_kinds();
  order_.sort();
}

void Detector::sweep() {
  const RegionObjects& objects = state_.objects;
  {
    SpanTimer time(state_.setup.track, "broad phase", state_.stats.broad_phase_ns);
    sweep_.begin(objects.bounds(), objects.present(), objects.resting(), objects.layers(), objects.groups(),
                 objects.crowds());
  }
  known_ = sweep_.kept_words();
  returned_ = 0;
  if (!knows_last_frame_) {
    std::fill(known_.begin(), known_.end(), untested);
  }
  bool more = true;
  while (more) {
    {
      SpanTimer time(state_.setup.track, "broad phase", state_.stats.broad_phase_ns);
      while (more && pairs_.size() < pairs_per_test) {
        const auto found = sweep_.next(pairs_per_test - pairs_.size());
        more = !found.empty();
        add_pairs(found);
      }
    }
    test_pairs();
  }
  state_.objects.settle();
  has_swept_ = true;
}

// The first pairs of a sweep are those of the resting set: takes their results of the last frame, if it knows them.
// Returns how many of `found` are such pairs.
std::size_t Detector::add_kept_pairs(std::span<const geometry::CandidatePair> found) {
  const std::size_t kept = std::min(found.size(), known_.size() - returned_);
  const PairObjects objects(state_);
  HitWriter writer(state_, hits_, touches_, order_);
  for (const geometry::CandidatePair& pair : found.first(kept)) {
    std::uint32_t& known = known_[returned_++];
    if (known == untested && objects.owns(pair)) {
      kept_of_batch_.push_back(may_carry(pair) ? &known : nullptr);
      pairs_.push_back(objects.ordered(pair));
      continue;
    }
    if (known == untested || known == of_other_node) {
      known = of_other_node;
      continue;
    }
    ++candidates_;
    ++carried_;
    if (known >= first_hit) {
      const std::size_t last = known - first_hit;
      assert((last_hits_[last].a ^ last_hits_[last].b) == (pair.a ^ pair.b));
      known = first_hit + static_cast<std::uint32_t>(hits_.size());
      writer.add(last_touches_[last], last_hits_[last]);
    }
  }
  return kept;
}

void Detector::add_pairs(std::span<const geometry::CandidatePair> found) {
  const PairObjects objects(state_);
  for (const geometry::CandidatePair& pair : found.subspan(add_kept_pairs(found))) {
    if (objects.owns(pair)) {
      pairs_.push_back(objects.ordered(pair));
    }
  }
}

bool Detector::may_carry(const geometry::CandidatePair& pair) const noexcept {
  const auto bodies = state_.objects.bodies();
  const auto is_support = [&](std::uint32_t i) {
    return state_.setup.shapes->row(bodies[i].shape).kind == ShapeKind::support;
  };
  return !is_support(pair.a) && !is_support(pair.b);
}

void Detector::test_pairs() {
  if (pairs_.empty()) {
    return;
  }
  SpanTimer time(state_.setup.track, "narrow phase", state_.stats.narrow_phase_ns);
  state_.fault.pass(NodeStage::kernel, state_.frame);
  for (std::uint32_t* const known : kept_of_batch_) {
    if (known != nullptr) {
      *known = apart;  // unless add_hits() finds it among the hits
    }
  }
  add_hits(narrow_.test(state_.objects.bodies(), pairs_));
  candidates_ += pairs_.size();
  pairs_.clear();
  kept_of_batch_.clear();
}

void Detector::add_hits(std::span<const narrow_phase::PairContact> found) {
  HitWriter writer(state_, hits_, touches_, order_);
  if (!kept_of_batch_.empty()) {
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i].pair < kept_of_batch_.size() && kept_of_batch_[found[i].pair] != nullptr) {
        *kept_of_batch_[found[i].pair] = first_hit + static_cast<std::uint32_t>(hits_.size() + i);
      }
    }
  }
  for (const narrow_phase::PairContact& touch : found) {
    writer.add(touch, pairs_[touch.pair]);
  }
}

void Detector::count_kinds() {
  tested_ = failed_supports_ = 0;
  kinds_.clear();
  for (std::uint32_t p = 0; p < shape_kinds; ++p) {
    for (std::uint32_t q = p; q < shape_kinds; ++q) {
      const auto& counters = narrow_.counters(static_cast<ShapeKind>(p), static_cast<ShapeKind>(q));
      if (counters.candidates != 0) {
        messages::KindRecord& record = kinds_.emplace_back(messages::KindRecord{p,
                                                                                q,
                                                                                counters.candidates,
                                                                                counters.hits,
                                                                                counters.lanes,
                                                                                counters.lanes_filled,
                                                                                counters.iterations,
                                                                                counters.ended_early,
                                                                                counters.timed,
                                                                                counters.nanoseconds,
                                                                                counters.gather_nanoseconds,
                                                                                {}});
        std::copy(std::begin(counters.cost), std::end(counters.cost), std::begin(record.cost));
        tested_ += counters.candidates;
        failed_supports_ += counters.failed;
      }
    }
  }
  narrow_.reset_counters();
}

}  // namespace ringfence::nodes
