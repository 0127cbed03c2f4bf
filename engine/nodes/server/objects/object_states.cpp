#include "nodes/server/objects/object_states.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

const Pose& ObjectStates::pose(std::uint32_t slot) const noexcept {
  const ObjectRow& row = state_.objects.row(slot);
  const Host* const host = owner(slot);
  return host == nullptr ? row.pose : (*host)[host->find(row.object.number)].pose;
}

// The host that has the current state of the object; null if the server's own copy is current.
const Host* ObjectStates::owner(std::uint32_t slot) const noexcept {
  const bool host_owned = exchange_.reads_nodes() && (state_.objects.marks(slot) & host_owned_mark) != 0;
  return host_owned ? &ServerExchange::host_of(state_.nodes[state_.objects.host(slot).number()]) : nullptr;
}

const std::byte* ObjectStates::state(std::uint32_t slot) const noexcept {
  const bool in_table = owner(slot) == nullptr && (state_.objects.marks(slot) & no_state_mark) == 0;
  return in_table ? state_.objects.state(slot) : state_in_host(slot);
}

// Precondition: a CD node of this process hosts the object.
const std::byte* ObjectStates::state_in_host(std::uint32_t slot) const noexcept {
  const Host& host = ServerExchange::host_of(state_.nodes[state_.objects.host(slot).number()]);
  return host.state(host.find(state_.objects.row(slot).object.number));
}

bool ObjectStates::nodes_keep_states() const noexcept {
  return exchange_.reads_nodes() && !state_.setup.nodes_may_be_lost;
}

void ObjectStates::release() noexcept {
  if (nodes_keep_states()) {
    state_.objects.release_states_of_nodes();
  }
}

void ObjectStates::fetch_state(std::uint32_t slot) {
  if ((state_.objects.marks(slot) & no_state_mark) != 0) {
    std::copy_n(state_in_host(slot), state_.objects.state_bytes(), state_.objects.new_state(slot));
  }
}

void ObjectStates::set_bounds(std::uint32_t slot) noexcept {
  const ObjectRow& row = state_.objects.row(slot);
  state_.objects.bounds(slot) = state_.setup.shapes->bounds(row.shape, row.pose, *state_.setup.space);
}

void ObjectStates::end_host_owned(std::uint32_t slot) {
  ObjectTable& objects = state_.objects;
  if ((objects.marks(slot) & host_owned_mark) == 0) {
    return;
  }
  if (const Host* const host = owner(slot)) {
    const std::uint32_t at = host->find(objects.row(slot).object.number);
    objects.change_row(slot).pose = (*host)[at].pose;
    std::copy_n(host->state(at), objects.state_bytes(), objects.new_state(slot));
  }
  objects.marks(slot) = static_cast<ObjectMarks>(objects.marks(slot) & ~host_owned_mark);
  set_bounds(slot);
  objects.note_notified(slot, objects.bounds(slot), state_.map.grid(), true);
}

void ObjectStates::apply_moves(Host& host) {
  const auto changed = host.changed();
  for (std::size_t begin = 0; begin < changed.size(); begin += Host::batch) {
    apply_batch(host, changed.subspan(begin, std::min(Host::batch, changed.size() - begin)));
  }
  state_.model_failures.add(host.failures().span());
  const HostRefusals& refusals = host.refusals();
  auto& refused = state_.report().refused;
  refused[static_cast<std::size_t>(Status::model_failed)] += refusals.model_failed;
  refused[static_cast<std::size_t>(Status::not_finite)] += refusals.not_finite;
  refused[static_cast<std::size_t>(Status::not_unit)] += refusals.not_unit;
}

void ObjectStates::apply_batch(Host& host, std::span<const std::uint32_t> changed) {
  constexpr std::size_t ahead = 6;
  ObjectTable& objects = state_.objects;
  geometry::PlacedShape placed[Host::batch];
  geometry::Bounds bounds[Host::batch];
  for (std::size_t i = 0; i < changed.size(); ++i) {
    const Hosted& hosted = host[changed[i]];
    placed[i] = {&hosted.pose, hosted.shape};
  }
  state_.setup.shapes->bounds({placed, changed.size()}, *state_.setup.space, bounds);
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (i + ahead < changed.size()) {
      objects.prefetch(host[changed[i + ahead]].object.slot);
    }
    const Hosted& hosted = host[changed[i]];
    const std::uint32_t slot = hosted.object.slot;
    ObjectRow& row = objects.change_row(slot);
    row.pose = hosted.pose;
    row.object.flags = hosted.object.flags & messages::flag_present;
    objects.set_jumped(slot, (hosted.object.flags & messages::flag_jumped) != 0);
    objects.bounds(slot) = bounds[i];
    std::copy_n(host.state(changed[i]), objects.state_bytes(), objects.new_state(slot));
    objects.mark_moved(slot);
  }
}

void ObjectStates::store(const PeerSession& node, std::uint64_t frame, const messages::ObjectRef& object,
                         const Pose& pose, const std::byte* state) {
  ObjectTable& objects = state_.objects;
  const std::uint32_t slot = objects.find(object);
  if (slot == base::NumberIndex::none || objects.host(slot) != node.self) {
    return;
  }
  ObjectMarks& marks = objects.marks(slot);
  if ((marks & (host_owned_mark | reported_mark)) != host_owned_mark) {
    return;
  }
  objects.change_row(slot).pose = pose;
  std::copy_n(state, objects.state_bytes(), objects.new_state(slot));
  bounds_are_stale_ = true;
  if (frame == state_.frame) {
    marks |= reported_mark;
    objects.mark_moved_host_only(slot);
    host_owned_moved_ -= node.lost ? 0 : 1;  // the node will report the number of states it kept
  }
}

void ObjectStates::store_all() {
  for (const PeerSession& node : state_.nodes) {
    if (!exchange_.reads_nodes() || !node.is_active()) {
      continue;
    }
    const Host& host = ServerExchange::host_of(node);
    for (std::size_t i = 0; i < host.size(); ++i) {
      if ((host[i].object.flags & messages::flag_host_owned) != 0) {
        store(node, state_.frame, host[i].object, host[i].pose, host.state(i));
      }
    }
  }
  if (!std::exchange(bounds_are_stale_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.present()[slot] != 0) {
      set_bounds(slot);
    }
  }
}

void ObjectStates::store_kept(const PeerSession& node, std::uint64_t frame) {
  if (!exchange_.reads_nodes()) {
    return;
  }
  const HostOwnedStates& kept = ServerExchange::kept_states(node);
  const std::span<const HostOwnedState> states = kept.of(frame);
  for (std::size_t i = 0; i < states.size(); ++i) {
    store(node, frame, states[i].object, states[i].pose, kept.state(frame, i));
  }
}

}  // namespace ringfence::nodes
