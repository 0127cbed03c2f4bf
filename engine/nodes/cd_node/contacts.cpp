// A CD node's contacts: the shared list, the comparison with the frame before, and the slice of the output lists.
#include <cstring>

#include "base/prefetch.hpp"
#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

// Lists the contacts in order of (a, b): lists in this order can be merged, and the host reads its contacts in this
// order when it moves next.
void CdNodeRole::list_contacts() {
  NodeContacts& node_contacts = *node_contacts_;
  node_contacts.start(frame_);
  node_contacts.contacts = nullptr;
  node_contacts.touches = touches_.data();
  node_contacts.bodies = region_objects_.bodies().data();
  node_contacts.keys.resize(hits_.size());
  node_contacts.found.resize(hits_.size());
  const bool notifies_others = setup_.hosts && node_contacts_ != &own_contacts_;
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    base::prefetch_for_write(node_contacts.keys.data() + i + 32);
    base::prefetch_for_write(node_contacts.found.data() + i + 16);
    const std::uint32_t touch = order_.at(i);
    const geometry::CandidatePair& hit = hits_[touch];
    node_contacts.keys[i] = order_.key_at(i);
    node_contacts.found[i] = {region_objects_.slot(hit.a), region_objects_.slot(hit.b), hit.a, hit.b, touch};
    if (keeps_contacts()) {
      host_.order_own_contact(frame_, node_contacts.keys[i], touch, region_objects_.hosted(hit.a),
                              region_objects_.hosted(hit.b));
    }
    if (notifies_others &&
        (region_objects_.next_host(hit.a) != NextHost::self || region_objects_.next_host(hit.b) != NextHost::self)) {
      list_notified_hosts(static_cast<std::uint32_t>(i));
    }
  }
  compare_contacts();
  if (notifies_others) {
    node_contacts.for_peers.finish(static_cast<NodeNumber>(setup_.peers.size()));
  }
}

// A pair is tested where its two bounds overlap. So if the bounds of one object touch only this node's region, its
// contacts are found here and nowhere else. The same holds for the frame before if the object was inner then and the
// map has not changed. After a change of the map the node receives all objects again, and was_inner() is false for
// them.
void CdNodeRole::compare_contacts() {
  const auto is_inner = [&](std::uint32_t slot, std::uint32_t was, ObjectNumber number) {
    const std::uint32_t known = region_objects_.find(slot, was);
    return known != RegionObjects::none && region_objects_.inner(known) && region_objects_.numbers()[known] == number;
  };
  node_contacts_->compare(
      [&](const FoundContact& found) {
        return region_objects_.was_inner(found.body_a) || region_objects_.was_inner(found.body_b);
      },
      [&](std::uint64_t key, const FoundContact& found) {
        return is_inner(found.slot_a, found.body_a, static_cast<ObjectNumber>(key >> 32)) ||
               is_inner(found.slot_b, found.body_b, static_cast<ObjectNumber>(key));
      });
  region_objects_.note_inner();
}

// Lists one contact for the CD nodes and user nodes that will host its objects in the next frame. These hosts follow
// from the objects' categories and positions, as long as the map does not change.
void CdNodeRole::list_notified_hosts(std::uint32_t position) {
  const FoundContact& found = node_contacts_->found[position];
  NodeNumber first = setup_.node;
  bool users = false;
  for (const std::uint32_t known : {found.body_a, found.body_b}) {
    users |= region_objects_.next_host(known) == NextHost::user;
    if (region_objects_.next_host(known) != NextHost::node) {
      continue;
    }
    std::uint32_t point[3];
    setup_.space->point(region_objects_.bodies()[known].pose.position, point);
    const NodeNumber next = map_.owner_at(point);
    if (next != setup_.node && next != first) {
      node_contacts_->for_peers.add(next, position);
      first = next;
    }
  }
  if (users) {
    node_contacts_->user_contacts.push_back({node_contacts_->keys[position], position, found});
  }
}

// Sets the phases of own contacts, writes a slice of the output lists, and reads the other nodes' contacts of hosted
// objects.
void CdNodeRole::finish_contacts() {
  if (keeps_contacts()) {
    confirm_begins();
  }
  if (node_contacts_ == &own_contacts_) {
    return;
  }
  NodeContacts& node_contacts = *node_contacts_;
  if (!node_contacts.gate.enter()) {
    return;  // this node is lost, and the shared memory may already belong to the next frame
  }
  fault_.pass(NodeStage::gate, frame_);
  node_contacts.duplicates = write_slice(*node_contacts.output_merge, node_contacts.share, output_merge_scratch_);
  if (setup_.hosts && node_contacts.nodes_exchange_contacts) {
    add_peer_contacts();
  }
  node_contacts.gate.leave();
}

// Contacts that begin are few and at random positions in the list, so all are prefetched before the first is changed.
void CdNodeRole::confirm_begins() {
  const NodeContacts& node_contacts = *node_contacts_;
  base::FlatList<std::uint32_t>& begins = output_merge_scratch_.begins;
  begins.clear();
  const std::uint8_t* const begun = node_contacts.begun.data();
  const std::size_t count = node_contacts.begun.size();
  for (std::size_t i = 0; i < count; ++i) {
    const void* const next = std::memchr(begun + i, 1, count - i);
    if (next == nullptr) {
      break;
    }
    i = static_cast<std::size_t>(static_cast<const std::uint8_t*>(next) - begun);
    begins.push_back(node_contacts.found[i].touch);
    host_.prefetch_own_contact(frame_, begins.back());
  }
  for (const std::uint32_t touch : begins) {
    host_.confirm_begin(frame_, touch);
  }
}

void CdNodeRole::add_peer_contacts() {
  const auto all = node_contacts_->output_merge->node_contacts;
  NodeContactOrder& order = output_merge_scratch_.order;
  order.start(all);
  // Other cores wrote the keys, and each peer has only a few for this node: prefetch all of them before the first read.
  for (const NodeContacts* node_contacts : all) {
    for (const std::uint32_t position : node_contacts->for_peers.of(setup_.node)) {
      base::prefetch_for_read(&node_contacts->keys[position]);
    }
  }
  for (NodeNumber peer = 0; peer < all.size(); ++peer) {
    const NodeContacts& node_contacts = *all[peer];
    for (const std::uint32_t position : node_contacts.for_peers.of(setup_.node)) {
      order.add(peer, position);
    }
  }
  order.sort();
  order.visit([&](std::uint64_t, NodeNumber peer, std::uint32_t position, Phase phase) {
    Contact contact;
    all[peer]->write(position, all[peer]->found[position], phase, contact);
    host_.add_contact(frame_, contact);
  });
  node_contacts_->taken = order.size();
}

}  // namespace ringfence::nodes
