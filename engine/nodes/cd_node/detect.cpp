// Broad and narrow phase of a CD node, and the sending of its contacts.
#include <algorithm>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::SpanTimer;

void CdNodeRole::sweep() {
  const auto bodies = region_objects_.bodies();
  const auto bounds = region_objects_.bounds();
  const auto marks = region_objects_.marks();
  const auto numbers = region_objects_.numbers();
  {
    SpanTimer time(setup_.track, "broad phase", frame_stats_.broad_phase_ns);
    sweep_.begin(bounds, region_objects_.present(), region_objects_.resting(), region_objects_.layers(),
                 region_objects_.groups());
  }
  bool more = true;
  while (more) {
    {
      SpanTimer time(setup_.track, "broad phase", frame_stats_.broad_phase_ns);
      while (more && pairs_.size() < pairs_per_test) {
        const auto found = sweep_.next(pairs_per_test - pairs_.size());
        more = !found.empty();
        for (const geometry::CandidatePair& pair : found) {
          // An object fully inside this region cannot collide in another one, so this node owns the pair.
          if (((marks[pair.a] | marks[pair.b]) & RegionObjects::inner_mark) == 0 &&
              map_.pair_owner(bounds[pair.a], bounds[pair.b]) != setup_.node) {
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
  region_objects_.settle();
}

// The batch is large enough for full blocks of every pair of kinds, and small enough that its objects stay in the cache
// from the sort to the kernels.
void CdNodeRole::test_pairs() {
  if (pairs_.empty()) {
    return;
  }
  SpanTimer time(setup_.track, "narrow phase", frame_stats_.narrow_phase_ns);
  fault_.pass(NodeStage::kernel, frame_);
  add_hits(narrow_.test(region_objects_.bodies(), pairs_));
  candidates_ += pairs_.size();
  pairs_.clear();
}

// Keeps the kernels' output, a quarter of a contact; the rest are poses, which are added where the contact is read in
// order. For the node's own model the contact is assembled at once, because the bodies will have moved when the model
// reads it in the next frame.
void CdNodeRole::add_hits(std::span<const narrow_phase::PairContact> found) {
  const auto numbers = region_objects_.numbers();
  const auto bodies = region_objects_.bodies();
  for (const narrow_phase::PairContact& touch : found) {
    const geometry::CandidatePair& pair = pairs_[touch.pair];
    touches_.push_back(touch);
    hits_.push_back(pair);
    base::prefetch_for_write(touches_.end() + 8);
    base::prefetch_for_write(hits_.end() + 32);
    order_.add(numbers[pair.a], numbers[pair.b]);
    if (keeps_contacts()) {
      NodeContacts::assemble(touch, bodies[pair.a], bodies[pair.b], Phase::persist, host_.add_own_contact(frame_));
    }
  }
}

void CdNodeRole::detect() {
  if (setup_.placement == Placement::region) {
    sweep();
  } else {
    test_pairs();
  }
  SpanTimer time(setup_.track, "narrow phase", frame_stats_.narrow_phase_ns);
  count_kinds();
  order_.sort();
  list_contacts();
  next_hit_ = 0;
  collisions_run_.start();
  change_run_.stop();
  if (const std::size_t changes = node_contacts_->beginning.size() + node_contacts_->ending.size(); changes != 0) {
    change_run_.start(changes);
  }
  done_run_.start(1);
}

// The kernels themselves count, so that "each pair once" is checked against the tests that were done, not those
// requested.
void CdNodeRole::count_kinds() {
  tested_ = failed_supports_ = 0;
  kinds_.clear();
  for (std::uint32_t p = 0; p < shape_kinds; ++p) {
    for (std::uint32_t q = p; q < shape_kinds; ++q) {
      const auto& counters = narrow_.counters(static_cast<ShapeKind>(p), static_cast<ShapeKind>(q));
      if (counters.candidates != 0) {
        messages::KindRecord& record = kinds_.emplace_back();
        record.first = p;
        record.second = q;
        record.candidates = counters.candidates;
        record.hits = counters.hits;
        record.lanes = counters.lanes;
        record.lanes_filled = counters.lanes_filled;
        record.iterations = counters.iterations;
        record.ended_early = counters.ended_early;
        record.timed = counters.timed;
        record.nanoseconds = counters.nanoseconds;
        record.gather_nanoseconds = counters.gather_nanoseconds;
        std::copy(std::begin(counters.cost), std::end(counters.cost), std::begin(record.cost));
        tested_ += counters.candidates;
        failed_supports_ += counters.failed;
      }
    }
  }
  narrow_.reset_counters();
}

// Only for a server in another process; in this process it reads the shared contacts.
bool CdNodeRole::send_collisions() {
  link::Sender& out = *setup_.server.out;
  const messages::RunHeader to_server = head(MessageType::collision, Endpoint::server());
  const bool shared = node_contacts_ != &own_contacts_;
  for (; !shared && next_hit_ < hits_.size(); ++next_hit_) {
    std::byte* where = collisions_run_.add(out, to_server, sizeof(messages::CollisionRecord), traffic_);
    if (where == nullptr) {
      return false;
    }
    const FoundContact& found = own_contacts_.found[next_hit_];
    const narrow_phase::PairContact& touch = touches_[found.touch];
    new (where) messages::CollisionRecord{found.slot_a, found.slot_b, touch.depth, touch.normal,
                                          own_contacts_.point(static_cast<std::uint32_t>(next_hit_))};
  }
  return (shared ||
          (collisions_run_.finish(out, to_server, sizeof(messages::CollisionRecord), traffic_) && send_changes())) &&
         done_run_.pump(out, head(MessageType::narrow_done, Endpoint::server()), sizeof(messages::NarrowDoneRecord),
                        traffic_, [&](std::size_t, std::byte* where) {
                          const messages::NarrowDoneRecord record{candidates_, tested_, hits_.size(), failed_supports_};
                          std::memcpy(where, &record, sizeof record);
                        });
}

bool CdNodeRole::send_changes() {
  return change_run_.pump(*setup_.server.out, head(MessageType::change, Endpoint::server()),
                          sizeof(messages::ChangeRecord), traffic_, [&](std::size_t i, std::byte* where) {
                            const messages::ChangeRecord record = change(i);
                            std::memcpy(where, &record, sizeof record);
                          });
}

// First the contacts that began, then those that ended.
messages::ChangeRecord CdNodeRole::change(std::size_t i) const noexcept {
  const NodeContacts& node_contacts = *node_contacts_;
  if (i >= node_contacts.beginning.size()) {
    const std::uint64_t key = node_contacts.ending[i - node_contacts.beginning.size()];
    const auto border = node_contacts.border_ending.span();
    const bool at_border = std::binary_search(border.begin(), border.end(), key);
    return {key, 0, messages::change_ended | (at_border ? messages::change_at_border : 0u)};
  }
  const std::uint32_t position = node_contacts.beginning[i];
  const auto border = node_contacts.border_beginning.span();
  const auto at =
      std::lower_bound(border.begin(), border.end(), position,
                       [](const BorderContact& contact, std::uint32_t to) { return contact.position < to; });
  const bool at_border = at != border.end() && at->position == position;
  return {node_contacts.keys[position], position, at_border ? messages::change_at_border : 0u};
}

bool CdNodeRole::send_kinds() {
  return kinds_run_.pump(*setup_.server.out, head(MessageType::kinds, Endpoint::server()), sizeof(messages::KindRecord),
                         traffic_,
                         [&](std::size_t i, std::byte* where) { std::memcpy(where, &kinds_[i], sizeof kinds_[i]); });
}

}  // namespace ringfence::nodes
