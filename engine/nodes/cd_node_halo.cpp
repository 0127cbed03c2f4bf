// What a CD node tells its peers of the objects that it hosts near their regions, and what it hears of theirs.
//
// After the positions of a frame every node knows exactly the present objects whose bounds touch its region. So who was
// told of an object in the frame before follows from its bounds in it, which its host has among the objects it knows.
#include "nodes/cd_node_role.hpp"

namespace ringfence::nodes {

// Of a hosted object that is kept from the server, before what is known of it is replaced. `inner`: all that the bounds
// touch is this node's. `was`: where it is among what is known, or KnownObjects::none.
void CdNodeRole::tell_peers(const Hosted& object, const geometry::Bounds& bounds, bool inner, std::uint32_t was) {
  const bool was_inner = was == KnownObjects::none || known_.inner()[was] != 0;
  if (inner && was_inner) {
    return;
  }
  Halo& halo = findings_->halo;
  ++stamp_;
  bool added = false;
  const auto tell = [&](NodeNumber peer, bool gone) {
    if (peer == setup_.node) {
      return;
    }
    if (!added) {
      messages::PositionRecord record{object.object, object.pose, bounds, object.shape, object.layer};
      record.object.flags = messages::flag_present;
      halo.add(record);
      added = true;
    }
    halo.tell(peer, gone);
  };
  if ((object.object.flags & messages::flag_present) != 0) {
    regions::for_each_owner(map_, bounds, stamps_, stamp_, [&](NodeNumber peer) { tell(peer, false); });
  }
  if (!was_inner) {
    regions::for_each_owner(map_, known_.bounds()[was], stamps_, stamp_, [&](NodeNumber peer) { tell(peer, true); });
  }
}

// Not in a frame in which the server tells all of everything: then the gate is barred.
void CdNodeRole::hear_peers() {
  if (!findings_->halo.gate.enter()) {
    return;
  }
  // A record, then where its object is known, then what is known of it: each look needs the one before.
  constexpr std::size_t ahead = 4;
  for (const Line& peer : setup_.peers) {
    if (peer.findings == nullptr || peer.findings->halo.frame() != frame_) {
      continue;
    }
    const Halo& halo = peer.findings->halo;
    const std::size_t told = halo.told(setup_.node);
    for (std::size_t i = 0; i < told; ++i) {
      if (i + 3 * ahead < told) {
        halo.fetch(halo.told(setup_.node, i + 3 * ahead).record);
      }
      if (i + 2 * ahead < told) {
        known_.fetch_index(halo.record(halo.told(setup_.node, i + 2 * ahead).record).object.slot);
      }
      if (i + ahead < told) {
        known_.fetch(halo.record(halo.told(setup_.node, i + ahead).record).object.slot, KnownObjects::none);
      }
      const Halo::Told one = halo.told(setup_.node, i);
      hear_position(halo.record(one.record), one.gone);
    }
  }
  findings_->halo.gate.leave();
}

}  // namespace ringfence::nodes
