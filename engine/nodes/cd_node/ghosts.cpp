// Ghost updates of a CD node: those for its peers, about hosted objects near their regions, and those received.
//
// After the positions of a frame every node knows exactly the present objects whose bounds touch its region. So the
// nodes that know an object from the frame before follow from its bounds in that frame, which its host has in its
// RegionObjects.
#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

// For a hosted object with host-owned state, before its entry in RegionObjects is replaced. `staying`: this node
// remains the host. `was`: index of the entry, or RegionObjects::none.
void CdNodeRole::add_ghost_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying,
                                   std::uint32_t was) {
  const Hosted& object = host_[hosted];
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
      ghost_updates.add(
          {update, object.pose, bounds, object.shape, object.layer, host_.group(hosted), 0, object.user_data});
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
  // Few objects pass from cell to cell in a frame, so usually no node loses one.
  const geometry::Bounds& bounds_before = region_objects_.bounds()[was];
  const regions::CellBox box = map_.grid().cells_of(bounds_before);
  if (present && box == map_.grid().cells_of(bounds) && !map_.has_cuts(box)) {
    return;
  }
  regions::for_each_owner(map_, bounds_before, stamps_, stamp_, [&](NodeNumber peer) { add_receiver(peer, true); });
}

// Skipped in a frame in which the server sends everything: then the gate is barred.
void CdNodeRole::receive_ghosts() {
  if (!node_contacts_->ghost_updates.gate.enter()) {
    return;
  }
  fault_.pass(NodeStage::gate, frame_);
  ghosts_.clear();
  for (const Connection& peer : setup_.peers) {
    if (peer.node_contacts != nullptr && peer.node_contacts->ghost_updates.frame() == frame_) {
      peer.node_contacts->ghost_updates.list(setup_.node, ghosts_);
    }
  }
  // The updates of all peers form one list, since each peer has only a few dozen. Three dependent reads are prefetched
  // in a pipeline: the record, written by another core; the index of its object; the object's entry.
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
