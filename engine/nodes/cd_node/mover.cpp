#include "nodes/cd_node/mover.hpp"

#include <utility>

#include "base/prefetch.hpp"
#include "nodes/exchange/publications.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using telemetry::SpanTimer;

Mover::Mover(NodeState& state, NodeExchange& exchange, HaloExchange& halo, Migration& migration)
    : state_(state),
      exchange_(exchange),
      halo_(halo),
      migration_(migration),
      keeps_(state.keeps_host_owned()),
      reports_rest_(state.reports_rest()),
      lists_next_hosts_(state.lists_next_hosts()) {}

void Mover::begin() {
  changed_ = {};
  done_ = false;
  const HostPublication* const publication = state_.setup.server.publication;
  publishes_ = publication != nullptr && publication->wanted;
  SpanTimer time(state_.setup.track, "move", state_.stats.move_ns);
  state_.host.begin_move(state_.frame);
  halo_.begin();
  exchange_.begin();
  state_.host.set_sensed(state_.contacts.sensed);
}

bool Mover::move() {
  SpanTimer time(state_.setup.track, "move", state_.stats.move_ns);
  while (exchange_.report_batch()) {
    if (!state_.host.move_next()) {
      done_ = exchange_.finish_report();
      return done_;
    }
    changed_ = state_.host.changed();
    bound_batch();
    place_batch();
  }
  return false;
}

void Mover::bound_batch() {
  geometry::PlacedShape placed[Host::batch];
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = state_.host[changed_[i]];
    placed[i] = {&object.pose, object.shape};
    state_.objects.prefetch_body(state_.host.place_in_list(changed_[i]));
  }
  state_.setup.shapes->bounds({placed, changed_.size()}, *state_.setup.space, bounds_.data(), points_.data());
}

// Runs after the bounds of the whole batch are computed. Reading bounds as a whole just after their parts were written
// would stall the processor.
void Mover::place_batch() {
  constexpr std::size_t ahead = 12;
  const auto prefetch = [&](std::size_t i) {
    if (i < changed_.size()) {
      state_.objects.prefetch(state_.host.place_in_list(changed_[i]));
    }
  };
  for (std::size_t i = 0; i < ahead; ++i) {
    prefetch(i);
  }
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    prefetch(i + ahead);
    const Placing placing = find(i);
    state_.host.differs()[i] != 0 ? place(placing) : rest(placing);
  }
}

Mover::Placing Mover::find(std::size_t i) const noexcept {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = state_.host[hosted];
  return {hosted,
          object,
          bounds_[i],
          points_[i].at,
          state_.objects.find(object.object.slot, state_.host.place_in_list(hosted)),
          (object.object.flags & messages::flag_present) != 0,
          (object.object.flags & messages::flag_host_owned) != 0};
}

// Updates the entry of the object, and decides whether the server and which peers need the change.
void Mover::place(const Placing& moved) {
  const geometry::Bounds& bounds = moved.bounds;
  const regions::Coverage coverage = moved.present ? state_.region.coverage(bounds) : regions::Coverage::none;
  const bool inner = coverage == regions::Coverage::all;
  const bool within = geometry::contains(bounds, moved.point);
  // The position of most objects is within their bounds. If the region contains these bounds, this node owns the cell
  // of the position.
  const NodeNumber next = inner && within ? state_.setup.node : state_.region.map().owner_at(moved.point);
  const bool staying = next == state_.setup.node;
  // If the position is within the bounds, the next host owns a cell that the bounds touch. So it receives a ghost
  // update too, and knows from the bounds which other nodes received one.
  const std::uint32_t jumped = moved.object.object.flags & messages::flag_jumped;
  const bool keeps = keeps_ && moved.present && jumped == 0 && ((inner && staying) || within);
  // The state becomes host-owned. Unless the server sends the object in this frame, all nodes that know it have the
  // same entry, as if its state had been host-owned while it rested.
  const bool begins = keeps && !moved.was_host_owned && lists_next_hosts_ && moved.was != RegionObjects::none &&
                      (moved.object.object.flags & messages::flag_renewed) == 0;
  const bool owned = moved.was_host_owned || begins;
  if (owned && !(inner && (moved.was == RegionObjects::none || state_.objects.inner(moved.was)))) {
    halo_.add_updates(moved.hosted, bounds, staying, moved.was);
  }
  if (coverage != regions::Coverage::none) {
    enter(moved, staying ? NextHost::self : NextHost::node, inner);
  } else {
    state_.objects.remove(moved.object.object.slot);
  }
  if (!staying) {
    migration_.add(moved.object.object.number, next);
  }
  state_.host.set_host_owned(moved.hosted, keeps);
  if (keeps && owned && (staying || lists_next_hosts_)) {
    if (begins || !staying) {
      exchange_.add_next_host(moved.object.object.slot, next);
    }
    return exchange_.add_owned(moved.hosted);
  }
  const std::uint32_t flags = (moved.present ? messages::flag_present : 0u) | (inner ? messages::flag_interior : 0u) |
                              (staying ? messages::flag_keeps_host : 0u) | (keeps ? messages::flag_host_owned : 0u) |
                              jumped;
  exchange_.add_change(moved.hosted, flags, bounds);
}

// The object did not move. It is in the batch because its state is host-owned and has to be reported, or because the
// map is new: no node knows the object under it yet.
void Mover::rest(const Placing& resting) {
  bool inner = resting.was != RegionObjects::none && state_.objects.inner(resting.was);
  if (resting.was == RegionObjects::none && resting.present) {
    const regions::Coverage coverage = state_.region.coverage(resting.bounds);
    inner = coverage == regions::Coverage::all;
    if (!inner) {
      halo_.add_updates(resting.hosted, resting.bounds, true, resting.was);
    }
    if (coverage != regions::Coverage::none) {
      enter(resting, NextHost::self, inner);
    }
  }
  const bool keeps =
      resting.was_host_owned && !reports_rest_ && (inner || geometry::contains(resting.bounds, resting.point));
  if (resting.was_host_owned && !keeps) {
    exchange_.add_change(resting.hosted,
                         messages::flag_present | messages::flag_keeps_host | messages::flag_at_rest |
                             (inner ? messages::flag_interior : 0u),
                         resting.bounds);
  }
  state_.host.set_host_owned(resting.hosted, keeps);
}

void Mover::enter(const Placing& placed, NextHost next, bool inner) {
  // A hosted object is not static.
  const auto filter = [&] { return PairFilter::of(placed.object.layer, false, state_.host.group(placed.hosted)); };
  state_.host.set_place_in_list(
      placed.hosted, state_.objects.set(placed.object, placed.bounds, filter, next, inner, placed.was, placed.hosted));
}

void Mover::publish() {
  if (!publishes_) {
    return;
  }
  std::uint64_t publish_ns = 0;
  SpanTimer time(state_.setup.track, "publish", publish_ns);
  HostPublication& own = *state_.setup.server.publication;
  own.publication.begin(state_.frame);
  own.publication.list_first(static_cast<std::uint32_t>(state_.host.size()));
  state_.fault.pass(NodeStage::publication, state_.frame);
  own.publication.publish([this](std::uint32_t i) { base::prefetch_object(state_.host[i]); },
                          [this](std::uint32_t i, PublishedState& to) {
                            const Hosted& object = state_.host[i];
                            to = {object.object.number, 0, object.pose};
                            const bool present = (object.object.flags & messages::flag_present) != 0;
                            return present ? Publication::Written::state : Publication::Written::nothing;
                          });
  note_published(own.published, state_.frame);
  exchange_.report_published();
}

}  // namespace ringfence::nodes
