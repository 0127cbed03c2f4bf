// What a CD node tells its peers of the objects that it hosts near their regions, and what it hears of theirs.
//
// After the positions of a frame every node knows exactly the present objects whose bounds touch its region. So who was
// told of an object in the frame before follows from its bounds in it, which its host has among the objects it knows.
#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

// Of a hosted object that is kept from the server, before what is known of it is replaced. `staying`: this node goes on
// hosting it. `was`: where it is among what is known, or RegionObjects::none.
void CdNodeRole::add_ghost_updates(const Hosted& object, const geometry::Bounds& bounds, bool staying,
                                   std::uint32_t was) {
  GhostUpdates& ghost_updates = node_contacts_->ghost_updates;
  ++stamp_;
  bool added = false;
  const auto add_receiver = [&](NodeNumber peer, bool gone) {
    if (peer == setup_.node) {
      return;
    }
    if (!added) {
      messages::ObjectRef update = object.object;
      update.flags = messages::flag_present | (staying ? messages::flag_keeps_host : 0u);
      ghost_updates.add({update, object.pose, bounds, object.shape, object.layer});
      added = true;
    }
    ghost_updates.add_receiver(peer, gone);
  };
  const bool present = (object.object.flags & messages::flag_present) != 0;
  if (present) {
    regions::for_each_owner(map_, bounds, stamps_, stamp_, [&](NodeNumber peer) { add_receiver(peer, false); });
  }
  if (was == RegionObjects::none || region_objects_.inner(was)) {
    return;
  }
  // Few pass from cell to cell in a frame, so that there is nobody whom they leave.
  const geometry::Bounds& bounds_before = region_objects_.bounds()[was];
  const regions::CellBox box = map_.grid().cells_of(bounds_before);
  if (present && box == map_.grid().cells_of(bounds) && !map_.has_cuts(box)) {
    return;
  }
  regions::for_each_owner(map_, bounds_before, stamps_, stamp_, [&](NodeNumber peer) { add_receiver(peer, true); });
}

// Not in a frame in which the server tells all of everything: then the gate is barred.
void CdNodeRole::receive_ghosts() {
  if (!node_contacts_->ghost_updates.gate.enter()) {
    return;
  }
  ghosts_.clear();
  for (const Connection& peer : setup_.peers) {
    if (peer.node_contacts != nullptr && peer.node_contacts->ghost_updates.frame() == frame_) {
      peer.node_contacts->ghost_updates.list(setup_.node, ghosts_);
    }
  }
  // What all peers tell as one list, since each of them tells a few dozen: a record, which another core wrote, then
  // where its object is known, then what is known of it. Each look needs the one before.
  constexpr std::size_t ahead = 6;
  const auto behind = [&](std::size_t i, std::size_t by) {
    return i >= by && i - by < ghosts_.size() ? &ghosts_[i - by] : nullptr;
  };
  for (std::size_t i = 0; i < ghosts_.size() + 3 * ahead; ++i) {
    if (const GhostUpdates::Update* update = behind(i, 0)) {
      GhostUpdates::prefetch(*update->record);
    }
    if (const GhostUpdates::Update* update = behind(i, ahead)) {
      region_objects_.prefetch_index(update->record->object.slot);
    }
    if (const GhostUpdates::Update* update = behind(i, 2 * ahead)) {
      region_objects_.prefetch(region_objects_.find(update->record->object.slot));
    }
    if (const GhostUpdates::Update* update = behind(i, 3 * ahead)) {
      apply_ghost(*update->record, update->gone);
    }
  }
  node_contacts_->ghost_updates.gate.leave();
}

}  // namespace ringfence::nodes
