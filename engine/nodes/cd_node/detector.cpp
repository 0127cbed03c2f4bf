#include "nodes/cd_node/detector.hpp"

#include <algorithm>
#include <cassert>

#include "base/prefetch.hpp"
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
  touches_.reserve(state.setup.objects);
  order_.reserve(state.setup.objects);
  narrow_.remember_axes(state.setup.remember_axes);
}

void Detector::discard() {
  pairs_.clear();
  hits_.clear();
  touches_.clear();
  order_.clear();
  candidates_ = 0;
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
  const auto bodies = state_.objects.bodies();
  const auto bounds = state_.objects.bounds();
  const auto marks = state_.objects.marks();
  const auto numbers = state_.objects.numbers();
  const regions::RegionMap& map = state_.region.map();
  {
    SpanTimer time(state_.setup.track, "broad phase", state_.stats.broad_phase_ns);
    sweep_.begin(bounds, state_.objects.present(), state_.objects.resting(), state_.objects.layers(),
                 state_.objects.groups(), state_.objects.crowds());
  }
  bool more = true;
  while (more) {
    {
      SpanTimer time(state_.setup.track, "broad phase", state_.stats.broad_phase_ns);
      while (more && pairs_.size() < pairs_per_test) {
        const auto found = sweep_.next(pairs_per_test - pairs_.size());
        more = !found.empty();
        for (const geometry::CandidatePair& pair : found) {
          // An object fully inside this region cannot collide in another one, so this node owns the pair.
          if (((marks[pair.a] | marks[pair.b]) & RegionObjects::inner_mark) == 0 &&
              map.pair_owner(bounds[pair.a], bounds[pair.b]) != state_.setup.node) {
            continue;
          }
          base::prefetch_for_read(&bodies[pair.a]);
          base::prefetch_for_read(&bodies[pair.b]);
          // Without a branch: half of all pairs are in the wrong order, at random, so a branch would often be
          // mispredicted.
          const std::uint32_t flip = (pair.a ^ pair.b) & (numbers[pair.b] < numbers[pair.a] ? ~0u : 0u);
          pairs_.push_back({pair.a ^ flip, pair.b ^ flip});
        }
      }
    }
    test_pairs();
  }
  state_.objects.settle();
}

void Detector::test_pairs() {
  if (pairs_.empty()) {
    return;
  }
  SpanTimer time(state_.setup.track, "narrow phase", state_.stats.narrow_phase_ns);
  state_.fault.pass(NodeStage::kernel, state_.frame);
  add_hits(narrow_.test(state_.objects.bodies(), pairs_));
  candidates_ += pairs_.size();
  pairs_.clear();
}

// Keeps the kernels' output, a quarter of a contact; the rest are poses, which are added where the contact is read in
// order. For the node's own model the contact is assembled at once, because the bodies will have moved when the model
// reads it in the next frame.
void Detector::add_hits(std::span<const narrow_phase::PairContact> found) {
  const auto numbers = state_.objects.numbers();
  const auto bodies = state_.objects.bodies();
  const bool keeps = state_.keeps_contacts();
  for (const narrow_phase::PairContact& touch : found) {
    const geometry::CandidatePair& pair = pairs_[touch.pair];
    touches_.push_back(touch);
    hits_.push_back(pair);
    base::prefetch_for_write(touches_.end() + 8);
    base::prefetch_for_write(hits_.end() + 32);
    order_.add(numbers[pair.a], numbers[pair.b]);
    if (keeps) {
      NodeContacts::assemble(touch, bodies[pair.a], bodies[pair.b], Phase::persist,
                             state_.host.contacts().add_own(state_.frame));
    }
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
  kinds_run_.start(kinds_.size());
}

bool Detector::send_kinds() {
  return state_.send(kinds_run_, MessageType::kinds, [this](std::size_t i) { return kinds_[i]; });
}

}  // namespace ringfence::nodes
