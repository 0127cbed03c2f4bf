// What a CD node shares of what it found, and what it does with what all have.
#include <cstring>

#include "nodes/cd_node_role.hpp"
#include "nodes/fetch.hpp"

namespace ringfence::nodes {

// In order of (a, b), so that runs can be merged and the host's next move reads its contacts in it.
void CdNodeRole::list_findings() {
  Findings& findings = *findings_;
  findings.start(frame_);
  findings.contacts = nullptr;
  findings.touches = touches_.data();
  findings.bodies = known_.bodies().data();
  findings.keys.resize(hits_.size());
  findings.found.resize(hits_.size());
  const bool tells = setup_.hosts && findings_ != &own_findings_;
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    fetch_to_write(findings.keys.data() + i + 32);
    fetch_to_write(findings.found.data() + i + 16);
    const std::uint32_t touch = order_.at(i);
    const geometry::CandidatePair& hit = hits_[touch];
    findings.keys[i] = order_.key_at(i);
    findings.found[i] = {known_.slot(hit.a), known_.slot(hit.b), hit.a, hit.b, touch};
    if (keeps_contacts()) {
      host_.order_own_contact(frame_, findings.keys[i], touch, known_.hosted(hit.a), known_.hosted(hit.b));
    }
    if (tells && (known_.next_host(hit.a) != NextHost::self || known_.next_host(hit.b) != NextHost::self)) {
      list_told(static_cast<std::uint32_t>(i));
    }
  }
  if (findings_ != &own_findings_) {
    compare_findings();
    findings.for_peers.finish(static_cast<NodeNumber>(setup_.peers.size()));
  }
}

// A pair is tested where its two bounds overlap. So where one object's touch this node's region alone, whatever touches
// it is found here and nowhere else. In the frame before that was so if it was known then, under the same map: under a
// new one all is told anew, and what is told for the first time was not inner.
void CdNodeRole::compare_findings() {
  const auto is_inner = [&](std::uint32_t slot, std::uint32_t was, ObjectNumber number) {
    const std::uint32_t known = known_.find(slot, was);
    return known != KnownObjects::none && known_.inner(known) && known_.numbers()[known] == number;
  };
  findings_->compare(
      [&](const FoundContact& found) { return known_.was_inner(found.body_a) || known_.was_inner(found.body_b); },
      [&](std::uint64_t key, const FoundContact& found) {
        return is_inner(found.slot_a, found.body_a, static_cast<ObjectNumber>(key >> 32)) ||
               is_inner(found.slot_b, found.body_b, static_cast<ObjectNumber>(key));
      });
  known_.note_inner();
}

// Who hosts the two objects in the next frame: that follows from what they are and where they stand, if the map stays.
void CdNodeRole::list_told(std::uint32_t position) {
  const FoundContact& found = findings_->found[position];
  NodeNumber first = setup_.node;
  bool users = false;
  for (const std::uint32_t known : {found.body_a, found.body_b}) {
    users |= known_.next_host(known) == NextHost::user;
    if (known_.next_host(known) != NextHost::node) {
      continue;
    }
    std::uint32_t point[3];
    setup_.space->point(known_.bodies()[known].pose.position, point);
    const NodeNumber next = map_.owner_at(point);
    if (next != setup_.node && next != first) {
      findings_->for_peers.add(next, position);
      first = next;
    }
  }
  if (users) {
    findings_->outer.push_back({findings_->keys[position], position, found});
  }
}

// The phases of what was found, a stretch of the embedder's list, and what others found of the hosted objects.
void CdNodeRole::finish_contacts() {
  if (findings_ == &own_findings_) {
    return;
  }
  Findings& findings = *findings_;
  if (keeps_contacts()) {
    confirm_begins();
  }
  if (!findings.gate.enter()) {
    return;  // lost, and what the others share is not for this frame any more
  }
  findings.doubled = write_stretch(*findings.listing, findings.share, listing_scratch_);
  if (setup_.hosts && findings.peers_tell) {
    take_from_peers();
  }
  findings.gate.leave();
}

// Few, and they lie anywhere.
void CdNodeRole::confirm_begins() {
  const Findings& findings = *findings_;
  FlatList<std::uint32_t>& begins = listing_scratch_.begins;
  begins.clear();
  const std::uint8_t* const begun = findings.begun.data();
  const std::size_t count = findings.begun.size();
  for (std::size_t i = 0; i < count; ++i) {
    const void* const next = std::memchr(begun + i, 1, count - i);
    if (next == nullptr) {
      break;
    }
    i = static_cast<std::size_t>(static_cast<const std::uint8_t*>(next) - begun);
    begins.push_back(findings.found[i].touch);
    host_.fetch_own_contact(frame_, begins.back());
  }
  for (const std::uint32_t touch : begins) {
    host_.confirm_begin(frame_, touch);
  }
}

void CdNodeRole::take_from_peers() {
  const auto all = findings_->listing->findings;
  FindingsOrder& order = listing_scratch_.order;
  order.start(all);
  // Another core wrote the keys, and each peer has but a few for this node: all are fetched before the first is read.
  for (const Findings* findings : all) {
    for (const std::uint32_t position : findings->for_peers.of(setup_.node)) {
      fetch_to_read(&findings->keys[position]);
    }
  }
  for (NodeNumber peer = 0; peer < all.size(); ++peer) {
    const Findings& findings = *all[peer];
    for (const std::uint32_t position : findings.for_peers.of(setup_.node)) {
      order.add(peer, position);
    }
  }
  order.sort();
  order.visit([&](std::uint64_t, NodeNumber peer, std::uint32_t position, Phase phase) {
    Contact contact;
    all[peer]->write(position, all[peer]->found[position], phase, contact);
    host_.add_contact(frame_, contact);
  });
  findings_->taken = order.size();
}

}  // namespace ringfence::nodes
