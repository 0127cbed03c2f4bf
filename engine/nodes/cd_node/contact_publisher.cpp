#include "nodes/cd_node/contact_publisher.hpp"

#include <algorithm>
#include <cstring>

#include "base/prefetch.hpp"
#include "nodes/exchange/output_merge.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

ContactPublisher::ContactPublisher(NodeState& state, const Detector& detector, NodeExchange& exchange)
    : state_(state), detector_(detector), exchange_(exchange) {
  state.contacts.for_peers.reserve(state.setup.objects);
  begins_.reserve(state.setup.objects);
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
  // The order is that of object numbers, so hits and objects are read at random: each stage reads what the one before
  // has prefetched.
  constexpr std::size_t ahead = 16;
  const std::size_t last = hits.size() - 1;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const std::uint32_t later = order.at(std::min(i + 2 * ahead, last));
    order.prefetch_added(later);
    base::prefetch_for_read(&hits[later]);
    const geometry::CandidatePair& soon = hits[order.at(std::min(i + ahead, last))];
    objects.prefetch_slot(soon.a);
    objects.prefetch_slot(soon.b);
    if (keeps) {
      objects.prefetch_hosted(soon.a);
      objects.prefetch_hosted(soon.b);
    }
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
  contacts.for_peers.finish(state_.setup.slots());
  exchange_.begin_contacts();
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

bool ContactPublisher::send() { return exchange_.send_contacts(detector_.totals()); }

void ContactPublisher::unlist(const messages::MessageView& message) {
  const auto keys = state_.contacts.keys.span();
  auto next = keys.begin();
  unlisted_.clear();
  for (std::size_t i = 0; i < message.count(); ++i) {
    next = std::lower_bound(next, keys.end(), message.record<messages::UnlistRecord>(i).key);
    unlisted_.push_back(static_cast<std::uint32_t>(next - keys.begin()));
  }
  state_.contacts.unlist(unlisted_.span());
}

void ContactPublisher::receive_corrections(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    state_.contacts.begun[message.record<messages::CorrectRecord>(i).position] = 0;
  }
}

void ContactPublisher::finish() {
  if (state_.keeps_contacts()) {
    state_.host.contacts().unlist_own(state_.frame, state_.contacts.keys.span());
    confirm_begins();
  }
  exchange_.share_contacts();
  if (state_.reads_output()) {
    const OutputMerge& output = *state_.contacts.output_merge;
    state_.host.contacts().read({output.contacts, output.size}, {output.keys, output.size});
  }
}

// Contacts that begin are few and at random positions in the list, so all are prefetched before the first is changed.
void ContactPublisher::confirm_begins() {
  const NodeContacts& contacts = state_.contacts;
  begins_.clear();
  const std::uint8_t* const begun = contacts.begun.data();
  const std::size_t count = contacts.begun.size();
  for (std::size_t i = 0; i < count; ++i) {
    const void* const next = std::memchr(begun + i, 1, count - i);
    if (next == nullptr) {
      break;
    }
    i = static_cast<std::size_t>(static_cast<const std::uint8_t*>(next) - begun);
    begins_.push_back(contacts.found[i].touch);
    state_.host.contacts().prefetch_own(state_.frame, begins_.back());
  }
  for (const std::uint32_t touch : begins_) {
    state_.host.contacts().confirm_begin(state_.frame, touch);
  }
}

}  // namespace ringfence::nodes
