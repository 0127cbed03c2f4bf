// Moves the hosted objects in batches and reports the changes to the server and the peers.
#include <cstring>
#include <new>

#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::SpanTimer;

// Moves and reports the hosted objects; false if the ring is full. The changes of a batch are sent while they are still
// in the cache, and the server receives them while the next batch is moved.
bool CdNodeRole::move() {
  SpanTimer time(setup_.track, "move", frame_stats_.move_ns);
  const messages::RunHeader to_server = head(MessageType::node_state, Endpoint::server());
  const std::size_t bytes = sizeof(messages::NodeStateRecord) + host_.state_bytes();
  for (;;) {
    for (; reported_changes_ != 0; ++next_changed_) {
      if (!reports_change_[next_changed_]) {
        continue;
      }
      std::byte* where = states_run_.add(*setup_.server.out, to_server, bytes, traffic_);
      if (where == nullptr) {
        return false;
      }
      write_own_move(next_changed_, where);
      --reported_changes_;
    }
    if (!host_.move_next()) {
      node_contacts_->host_states.finish();
      node_contacts_->ghost_updates.finish(static_cast<NodeNumber>(setup_.peers.size()));
      return states_run_.finish(*setup_.server.out, to_server, bytes, traffic_);
    }
    changed_ = host_.changed();
    next_changed_ = 0;
    bound_batch();
    place_batch();
  }
}

void CdNodeRole::bound_batch() {
  geometry::PlacedShape placed[Host::batch];
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = host_[changed_[i]];
    placed[i] = {&object.pose, object.shape};
  }
  setup_.shapes->bounds({placed, changed_.size()}, *setup_.space, changed_bounds_.data(), changed_points_.data());
}

// Runs after the bounds of the whole batch are computed. Reading bounds as a whole just after their parts were written
// would stall the processor.
void CdNodeRole::place_batch() {
  if (publishes_) {
    note_cells();
  }
  constexpr std::size_t ahead = 12;
  const auto prefetch = [&](std::size_t i) {
    if (i < changed_.size()) {
      region_objects_.prefetch(host_.place_in_list(changed_[i]));
    }
  };
  for (std::size_t i = 0; i < ahead; ++i) {
    prefetch(i);
  }
  reported_changes_ = 0;
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    prefetch(i + ahead);
    if (host_.differs()[i]) {
      place(i);
    } else {
      rest(i);
    }
    reported_changes_ += reports_change_[i] ? 1 : 0;
  }
}

// Stores the cells in which the changed objects are published. The other objects are at rest, and still in the cell
// stored before.
void CdNodeRole::note_cells() {
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    host_.set_cell(changed_[i], relay_cell(host_[changed_[i]], changed_points_[i].at));
  }
}

// Object i of the batch did not move. If its state was host-owned, the server does not have it, so it is reported now.
// Otherwise the object is in the batch because the map is new: no node knows the object under it yet.
void CdNodeRole::rest(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const auto filter = [&] { return PairFilter::of(object.layer, false, host_.group(hosted)); };  // hosted: not static
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t was = region_objects_.find(object.object.slot, host_.place_in_list(hosted));
  bool inner = was != RegionObjects::none && region_objects_.inner(was);
  if (was == RegionObjects::none && (object.object.flags & messages::flag_present) != 0) {
    const regions::Coverage coverage = cover_of(bounds);
    inner = coverage == regions::Coverage::all;
    if (!inner) {
      add_ghost_updates(hosted, bounds, true, was);
    }
    if (coverage != regions::Coverage::none) {
      host_.set_place_in_list(hosted, region_objects_.set(object, bounds, filter, NextHost::self, inner, was, hosted));
    }
  }
  reports_change_[i] = (object.object.flags & messages::flag_host_owned) != 0;
  changed_flags_[i] = messages::flag_present | messages::flag_keeps_host | messages::flag_at_rest |
                      (inner ? messages::flag_interior : 0u);
  host_.set_host_owned(hosted, false);
}

regions::Coverage CdNodeRole::cover_of(const geometry::Bounds& bounds) const noexcept {
  return geometry::contains(interior_, bounds) ? regions::Coverage::all : map_.coverage(bounds, setup_.node);
}

// Updates the entry of object i of the batch, and decides whether the server and which peers need the change.
void CdNodeRole::place(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const auto filter = [&] { return PairFilter::of(object.layer, false, host_.group(hosted)); };  // hosted: not static
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t* const point = changed_points_[i].at;
  const bool present = (object.object.flags & messages::flag_present) != 0;
  const bool was_host_owned = (object.object.flags & messages::flag_host_owned) != 0;
  const regions::Coverage coverage = present ? cover_of(bounds) : regions::Coverage::none;
  const bool inner = coverage == regions::Coverage::all;
  const bool within = geometry::contains(bounds, point);
  // The position of most objects is within their bounds. If the region contains these bounds, this node owns the cell
  // of the position.
  const NodeNumber next = inner && within ? setup_.node : map_.owner_at(point);
  const bool staying = next == setup_.node;
  const std::uint32_t was = region_objects_.find(object.object.slot, host_.place_in_list(hosted));
  if (was_host_owned && !(inner && (was == RegionObjects::none || region_objects_.inner(was)))) {
    add_ghost_updates(hosted, bounds, staying, was);
  }
  if (coverage != regions::Coverage::none) {
    const std::uint32_t known =
        region_objects_.set(object, bounds, filter, staying ? NextHost::self : NextHost::node, inner, was, hosted);
    host_.set_place_in_list(hosted, known);
  } else {
    region_objects_.remove(object.object.slot);
  }
  if (!staying) {
    leaving_objects_.push_back({object.object.number, next});
  }
  // If the position is within the bounds, the next host owns a cell that the bounds touch. So it receives a ghost
  // update too, and knows from the bounds which other nodes received one.
  const bool keeps = keeps_host_owned_ && present && ((inner && staying) || within);
  reports_change_[i] = !keeps || !staying || !was_host_owned;
  frame_stats_.host_owned_changes += reports_change_[i] ? 0 : 1;
  if (!reports_change_[i] && setup_.may_be_lost) {
    node_contacts_->host_states.add(frame_, object.object, object.pose, host_.state(hosted));
  }
  changed_flags_[i] = (present ? messages::flag_present : 0u) | (inner ? messages::flag_interior : 0u) |
                      (staying ? messages::flag_keeps_host : 0u) | (keeps ? messages::flag_host_owned : 0u);
  host_.set_host_owned(hosted, keeps);
}

// Writes the report of object i of the batch. The server does not send the object back: it sends a node every object in
// its region except those that the node itself hosts and has reported.
void CdNodeRole::write_own_move(std::size_t i, std::byte* where) {
  const Hosted& object = host_[changed_[i]];
  auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, changed_bounds_[i]};
  record->object.flags = changed_flags_[i];
  if (host_.state_bytes() != 0) {
    std::memcpy(where + sizeof *record, host_.state(changed_[i]), host_.state_bytes());
  }
}

std::uint32_t CdNodeRole::relay_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept {
  return (object.object.flags & messages::flag_present) != 0 ? setup_.interest_grid.cell_of(point) : Host::unpublished;
}

}  // namespace ringfence::nodes
