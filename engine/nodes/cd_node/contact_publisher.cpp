#include "nodes/cd_node/contact_publisher.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

ContactPublisher::ContactPublisher(NodeState& state, const Detector& detector) : state_(state), detector_(detector) {
  state.contacts.for_peers.reserve(state.setup.objects);
  scratch_.reserve(state.setup.objects);
}

void ContactPublisher::list() {
  NodeContacts& contacts = state_.contacts;
  const RegionObjects& objects = state_.objects;
  const auto hits = detector_.hits();
  const base::PairSort& order = detector_.order();
  contacts.start(state_.frame);
  contacts.touches = detector_.touches().data();
  contacts.bodies = objects.bodies().data();
  contacts.keys.resize(hits.size());
  contacts.found.resize(hits.size());
  const bool keeps = state_.keeps_contacts();
  const bool notifies_others = state_.setup.hosts;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    base::prefetch_for_write(contacts.keys.data() + i + 32);
    base::prefetch_for_write(contacts.found.data() + i + 16);
    const std::uint32_t touch = order.at(i);
    const geometry::CandidatePair& hit = hits[touch];
    contacts.keys[i] = order.key_at(i);
    contacts.found[i] = {objects.slot(hit.a), objects.slot(hit.b), hit.a, hit.b, touch};
    if (keeps) {
      state_.host.contacts().order_own(state_.frame, contacts.keys[i], touch, objects.hosted(hit.a),
                                       objects.hosted(hit.b));
    }
    if (notifies_others && (objects.next_host(hit.a) != NextHost::self || objects.next_host(hit.b) != NextHost::self)) {
      list_notified_hosts(static_cast<std::uint32_t>(i));
    }
  }
  compare();
  contacts.for_peers.finish(static_cast<NodeNumber>(state_.setup.peers.size()));
  list_counts();
  next_hit_ = 0;
  collisions_run_.start();
  change_run_.stop();
  if (const std::size_t changes = contacts.beginning.size() + contacts.ending.size(); changes != 0) {
    change_run_.start(changes);
  }
  done_run_.start(1);
}

// What arrived in this frame before is void, because the frame is detected again.
void ContactPublisher::list_counts() {
  peers_.assign(state_.setup.peers.size(), {});
  received_.clear();
  counts_.clear();
  arrived_ = expected_ = 0;
  counts_run_.stop();
  for (NodeNumber to = 0; !state_.shares_memory() && to < peers_.size(); ++to) {
    if (const std::size_t contacts = state_.contacts.for_peers.of(to).size(); contacts != 0) {
      counts_.push_back({to, static_cast<std::uint32_t>(contacts)});
    }
  }
  if (!counts_.empty()) {
    counts_run_.start(counts_.size());
  }
}

// A pair is tested where its two bounds overlap. So if the bounds of one object touch only this node's region, its
// contacts are found here and nowhere else. The same holds for the frame before if the object was inner then and the
// map has not changed. After a change of the map the node receives all objects again, and was_inner() is false for
// them.
void ContactPublisher::compare() {
  const auto is_inner = [&](std::uint32_t slot, std::uint32_t was, ObjectNumber number) {
    const std::uint32_t known = state_.objects.find(slot, was);
    return known != RegionObjects::none && state_.objects.inner(known) && state_.objects.numbers()[known] == number;
  };
  state_.contacts.compare(
      [&](const FoundContact& found) {
        return state_.objects.was_inner(found.body_a) || state_.objects.was_inner(found.body_b);
      },
      [&](std::uint64_t key, const FoundContact& found) {
        return is_inner(found.slot_a, found.body_a, static_cast<ObjectNumber>(key >> 32)) ||
               is_inner(found.slot_b, found.body_b, static_cast<ObjectNumber>(key));
      });
  state_.objects.note_inner();
}

// Lists one contact for the CD nodes and user nodes that will host its objects in the next frame. These hosts follow
// from the objects' categories and positions, as long as the map does not change.
void ContactPublisher::list_notified_hosts(std::uint32_t position) {
  const FoundContact& found = state_.contacts.found[position];
  NodeNumber first = state_.setup.node;
  bool users = false;
  for (const std::uint32_t known : {found.body_a, found.body_b}) {
    users |= state_.objects.next_host(known) == NextHost::user;
    if (state_.objects.next_host(known) != NextHost::node) {
      continue;
    }
    const NodeNumber next = state_.region.owner_at(state_.objects.bodies()[known].pose.position);
    if (next != state_.setup.node && next != first) {
      state_.contacts.for_peers.add(next, position);
      first = next;
    }
  }
  if (users) {
    state_.contacts.user_contacts.push_back({state_.contacts.keys[position], position, found});
  }
}

bool ContactPublisher::send() {
  return (state_.shares_memory() || (send_collisions() && send_changes())) &&
         state_.send_counts(counts_run_, MessageType::contact_counts, counts_) &&
         done_run_.pump(*state_.setup.server.out, state_.head(MessageType::narrow_done, Endpoint::server()),
                        sizeof(messages::NarrowDoneRecord), state_.traffic, [&](std::size_t, std::byte* where) {
                          const messages::NarrowDoneRecord record = detector_.totals();
                          std::memcpy(where, &record, sizeof record);
                        });
}

bool ContactPublisher::send_collisions() {
  link::Sender& out = *state_.setup.server.out;
  const messages::RunHeader to_server = state_.head(MessageType::collision, Endpoint::server());
  const NodeContacts& contacts = state_.contacts;
  for (; next_hit_ < contacts.found.size(); ++next_hit_) {
    std::byte* where = collisions_run_.add(out, to_server, sizeof(messages::CollisionRecord), state_.traffic);
    if (where == nullptr) {
      return false;
    }
    const FoundContact& found = contacts.found[next_hit_];
    const narrow_phase::PairContact& touch = contacts.touches[found.touch];
    new (where) messages::CollisionRecord{found.slot_a, found.slot_b, 0, touch.depth, touch.normal, touch.point};
  }
  return collisions_run_.finish(out, to_server, sizeof(messages::CollisionRecord), state_.traffic);
}

void ContactPublisher::flush() {
  collisions_run_.flush(*state_.setup.server.out, state_.head(MessageType::collision, Endpoint::server()),
                        sizeof(messages::CollisionRecord), state_.traffic);
}

bool ContactPublisher::send_changes() {
  return change_run_.pump(*state_.setup.server.out, state_.head(MessageType::change, Endpoint::server()),
                          sizeof(messages::ChangeRecord), state_.traffic, [&](std::size_t i, std::byte* where) {
                            const messages::ChangeRecord record = change(i);
                            std::memcpy(where, &record, sizeof record);
                          });
}

// First the contacts that began, then those that ended.
messages::ChangeRecord ContactPublisher::change(std::size_t i) const noexcept {
  const NodeContacts& contacts = state_.contacts;
  if (i >= contacts.beginning.size()) {
    const std::uint64_t key = contacts.ending[i - contacts.beginning.size()];
    const auto border = contacts.border_ending.span();
    const bool at_border = std::binary_search(border.begin(), border.end(), key);
    return {key, 0, messages::change_ended | (at_border ? messages::change_at_border : 0u)};
  }
  const std::uint32_t position = contacts.beginning[i];
  const auto border = contacts.border_beginning.span();
  const auto at =
      std::lower_bound(border.begin(), border.end(), position,
                       [](const BorderContact& contact, std::uint32_t to) { return contact.position < to; });
  const bool at_border = at != border.end() && at->position == position;
  return {contacts.keys[position], position, at_border ? messages::change_at_border : 0u};
}

void ContactPublisher::receive_corrections(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    state_.contacts.begun[message.record<messages::CorrectRecord>(i).position] = 0;
  }
}

void ContactPublisher::receive(const messages::MessageView& message) {
  arrived_ += message.count();
  peers_[Endpoint{message.header().source}.number()].arrived += message.count();
  for (std::size_t i = 0; i < message.count(); ++i) {
    received_.push_back(message.record<Contact>(i));
  }
}

void ContactPublisher::lose(const messages::LostRecord& record) noexcept {
  if (record.detect_again == 0 && record.node < peers_.size()) {
    expected_ -= record.contacts;
    arrived_ -= std::exchange(peers_[record.node].arrived, 0);
    peers_[record.node].run.stop();
    peers_[record.node].lost = true;
  }
}

bool ContactPublisher::send_to_peers() {
  bool all = true;
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    if (peers_[to].run.done()) {
      continue;
    }
    const auto positions = state_.contacts.for_peers.of(to);
    all &= peers_[to].run.pump(*state_.setup.peers[to].out, state_.head(MessageType::notify, Endpoint::node(to)),
                               sizeof(Contact), state_.traffic, [&](std::size_t i, std::byte* where) {
                                 const NodeContacts& contacts = state_.contacts;
                                 const std::uint32_t at = positions[i];
                                 Contact contact;
                                 contacts.write(contacts.found[at], contacts.phase(at), contact);
                                 std::memcpy(where, &contact, sizeof contact);
                               });
  }
  return all;
}

void ContactPublisher::add_received() {
  const auto key = [](const Contact& contact) { return base::PairSort::key(contact.a, contact.b); };
  std::sort(received_.begin(), received_.end(), [&](const Contact& p, const Contact& q) { return key(p) < key(q); });
  for (const Contact& contact : received_) {
    state_.host.contacts().add(state_.frame, contact);
  }
  received_.clear();
}

void ContactPublisher::finish() {
  if (state_.keeps_contacts()) {
    confirm_begins();
  }
  if (!state_.shares_memory()) {
    for (const messages::CountRecord& to : counts_) {
      if (!peers_[to.node].lost) {
        peers_[to.node].run.start(to.count);
      }
    }
    return;
  }
  NodeContacts& contacts = state_.contacts;
  if (!contacts.gate.enter()) {
    return;  // this node is lost, and the shared memory may already belong to the next frame
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  contacts.duplicates = write_slice(*contacts.output_merge, contacts.share, scratch_);
  if (state_.setup.hosts) {
    read_peer_contacts();
  }
  contacts.gate.leave();
}

// Contacts that begin are few and at random positions in the list, so all are prefetched before the first is changed.
void ContactPublisher::confirm_begins() {
  const NodeContacts& contacts = state_.contacts;
  base::FlatList<std::uint32_t>& begins = scratch_.begins;
  begins.clear();
  const std::uint8_t* const begun = contacts.begun.data();
  const std::size_t count = contacts.begun.size();
  for (std::size_t i = 0; i < count; ++i) {
    const void* const next = std::memchr(begun + i, 1, count - i);
    if (next == nullptr) {
      break;
    }
    i = static_cast<std::size_t>(static_cast<const std::uint8_t*>(next) - begun);
    begins.push_back(contacts.found[i].touch);
    state_.host.contacts().prefetch_own(state_.frame, begins.back());
  }
  for (const std::uint32_t touch : begins) {
    state_.host.contacts().confirm_begin(state_.frame, touch);
  }
}

void ContactPublisher::read_peer_contacts() {
  const auto all = state_.contacts.output_merge->node_contacts;
  NodeContactOrder& order = scratch_.order;
  order.start(all);
  // Other cores wrote the keys, and each peer has only a few for this node: prefetch all of them before the first read.
  for (const NodeContacts* node_contacts : all) {
    for (const std::uint32_t position : node_contacts->for_peers.of(state_.setup.node)) {
      base::prefetch_for_read(&node_contacts->keys[position]);
    }
  }
  for (NodeNumber peer = 0; peer < all.size(); ++peer) {
    const NodeContacts& node_contacts = *all[peer];
    for (const std::uint32_t position : node_contacts.for_peers.of(state_.setup.node)) {
      order.add(peer, position);
    }
  }
  order.sort();
  order.visit([&](std::uint64_t, NodeNumber peer, std::uint32_t position, Phase phase) {
    Contact contact;
    all[peer]->write(all[peer]->found[position], phase, contact);
    state_.host.contacts().add(state_.frame, contact);
  });
  state_.contacts.taken = order.size();
}

}  // namespace ringfence::nodes
