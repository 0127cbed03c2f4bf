// What a CD node tells its peers of the objects that it hosts near their regions, and what it hears of theirs.
//
// After the positions of a frame every node knows exactly the present objects whose bounds touch its region. So who was
// told of an object in the frame before follows from its bounds in it, which its host has among the objects it knows.
#include "nodes/cd_node_role.hpp"

namespace ringfence::nodes {

// Of a hosted object that is kept from the server, before what is known of it is replaced. `staying`: this node goes on
// hosting it. `was`: where it is among what is known, or KnownObjects::none.
void CdNodeRole::tell_peers(const Hosted& object, const geometry::Bounds& bounds, bool staying, std::uint32_t was) {
  Halo& halo = findings_->halo;
  ++stamp_;
  bool added = false;
  const auto tell = [&](NodeNumber peer, bool gone) {
    if (peer == setup_.node) {
      return;
    }
    if (!added) {
      messages::ObjectRef told = object.object;
      told.flags = messages::flag_present | (staying ? messages::flag_staying : 0u);
      halo.add({told, object.pose, bounds, object.shape, object.layer});
      added = true;
    }
    halo.tell(peer, gone);
  };
  const bool present = (object.object.flags & messages::flag_present) != 0;
  if (present) {
    regions::for_each_owner(map_, bounds, stamps_, stamp_, [&](NodeNumber peer) { tell(peer, false); });
  }
  if (was == KnownObjects::none || known_.inner(was)) {
    return;
  }
  // Few pass from cell to cell in a frame, so that there is nobody whom they leave.
  const geometry::Bounds& bounds_before = known_.bounds()[was];
  const regions::CellBox box = map_.grid().cells_of(bounds_before);
  if (present && box == map_.grid().cells_of(bounds) && !map_.has_cuts(box)) {
    return;
  }
  regions::for_each_owner(map_, bounds_before, stamps_, stamp_, [&](NodeNumber peer) { tell(peer, true); });
}

// Not in a frame in which the server tells all of everything: then the gate is barred.
void CdNodeRole::hear_peers() {
  if (!findings_->halo.gate.enter()) {
    return;
  }
  heard_.clear();
  for (const Line& peer : setup_.peers) {
    if (peer.findings != nullptr && peer.findings->halo.frame() == frame_) {
      peer.findings->halo.list(setup_.node, heard_);
    }
  }
  // What all peers tell as one list, since each of them tells a few dozen: a record, which another core wrote, then
  // where its object is known, then what is known of it. Each look needs the one before.
  constexpr std::size_t ahead = 6;
  const auto behind = [&](std::size_t i, std::size_t by) {
    return i >= by && i - by < heard_.size() ? &heard_[i - by] : nullptr;
  };
  for (std::size_t i = 0; i < heard_.size() + 3 * ahead; ++i) {
    if (const Halo::Told* told = behind(i, 0)) {
      Halo::fetch(*told->record);
    }
    if (const Halo::Told* told = behind(i, ahead)) {
      known_.fetch_index(told->record->object.slot);
    }
    if (const Halo::Told* told = behind(i, 2 * ahead)) {
      known_.fetch(known_.find(told->record->object.slot));
    }
    if (const Halo::Told* told = behind(i, 3 * ahead)) {
      hear_peer(*told->record, told->gone);
    }
  }
  findings_->halo.gate.leave();
}

}  // namespace ringfence::nodes
