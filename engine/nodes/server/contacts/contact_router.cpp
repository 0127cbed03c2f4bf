#include "nodes/server/contacts/contact_router.hpp"

#include <algorithm>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

void ContactRouter::resolve_phases() {
  ContactLedger& ledger = state_.ledger;
  ledger.resolve_phases();
  ledger.share_out();
  state_.report().contacts = ledger.size();
  state_.report().unlisted = ledger.unlisted();
  state_.report().ended = ledger.ends();
  if (ledger.unlisted() != 0) {
    start_unlisting();
  }
}

void ContactRouter::start_unlisting() {
  state_.all_nodes([&](PeerSession& node) {
    const auto unlisted = state_.ledger.unlisted(node.self.number());
    exchange_.retract_contacts(node, unlisted);
    if (!unlisted.empty()) {
      node.closing.unlist_run.start(unlisted.size());
    }
    return true;
  });
}

void ContactRouter::list_next_hosts() {
  constexpr std::size_t ahead = 8;  // they are at random slots
  next_hosts_.clear();
  exchange_.list_next_hosts(next_hosts_);
  ObjectTable& objects = state_.objects;
  for (std::size_t i = 0; i < next_hosts_.size(); ++i) {
    objects.prefetch_host(next_hosts_[std::min(i + ahead, next_hosts_.size() - 1)].slot);
    const NextHostOf& object = next_hosts_[i];
    objects.marks(object.slot) |= host_owned_mark | no_state_mark;
    if (objects.host(object.slot).number() != object.next) {
      state_.leaving.push_back(object);
    }
  }
}

void ContactRouter::assign_next_hosts() {
  if (!state_.nodes_host()) {
    return;
  }
  ObjectTable& objects = state_.objects;
  const auto is_hosted = [&](std::uint32_t slot) { return objects.alive(slot) && objects.host(slot).is_node(); };
  if (state_.map_change.at_end) {
    // The nodes listed contacts for the next hosts by the map before. Objects that leave by that map may stay by the
    // new.
    for (const NextHostOf& object : state_.leaving) {
      state_.note_host_change(object.slot);
    }
  }
  if (state_.map_change.at_end && state_.map_change.hosts_exchange_objects && exchange_.reads_nodes()) {
    for (const PeerSession& node : state_.nodes) {
      if (node.connected) {
        follow_hosted(node, ServerExchange::host_of(node));
      }
    }
  } else if (state_.map_change.at_end || state_.map_change.rescan_hosts) {
    for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
      if (is_hosted(slot)) {
        follow(slot, state_.owner_at(objects.row(slot).pose.position));
      }
    }
  } else {
    constexpr std::size_t ahead = 8;  // they are at random slots
    const std::vector<NextHostOf>& leaving = state_.leaving;
    for (std::size_t i = 0; i < leaving.size(); ++i) {
      objects.prefetch_host(leaving[std::min(i + ahead, leaving.size() - 1)].slot);
      if (is_hosted(leaving[i].slot)) {
        follow(leaving[i].slot, leaving[i].next);
      }
    }
  }
}

void ContactRouter::follow(std::uint32_t slot, NodeNumber next) {
  const NodeNumber host = state_.objects.host(slot).number();
  if (host != next) {
    state_.hand_overs.push_back({slot, host, next});
    if (state_.map_change.at_end) {
      state_.note_host_change(slot);
    }
    state_.objects.set_host(slot, Endpoint::node(next));
    state_.objects.marks(slot) |= shared_mark;  // the old host knows it, too
    ++state_.nodes[next].hand_overs;
    ++state_.report().handed_over;
  }
}

// The nodes wait meanwhile. Host-owned states of objects that change hosts are stored here: if the next host were lost,
// no other role would have them.
void ContactRouter::follow_hosted(const PeerSession& node, const Host& host) {
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Hosted& hosted = host[i];
    const NodeNumber next = state_.owner_at(hosted.pose.position);
    if (next != node.self.number()) {
      states_.store(node, state_.frame, hosted.object, hosted.pose, host.state(i));
      follow(hosted.object.slot, next);
    }
  }
}

void ContactRouter::start_nodes() {
  const bool exchange = state_.map_change.at_end && state_.map_change.hosts_exchange_objects;
  const auto prefetch = [](const PeerSession& node) { base::prefetch_for_write(&node.end_run); };
  state_.all_nodes(prefetch, [&](PeerSession& node) {
    const std::size_t corrections = exchange_.reads_nodes() ? 0 : state_.ledger.corrections(node.self.number()).size();
    if (corrections != 0) {
      node.closing.correct_run.start(corrections);
    }
    exchange_.start_end(node, exchange);
    if (state_.map_change.at_end) {
      node.closing.map_run.start(state_.map.table().size());
    }
    return true;
  });
}

void ContactRouter::start_users() {
  list_notices();
  users_are_notified_ = false;
  for (UserConnection& peers : state_.user_connections) {
    std::sort(peers.notified.begin(), peers.notified.end());
    for (const UserNumber user : peers.notified) {
      PeerSession::Closing& closing = state_.users[user].closing;
      closing.notice_run.start(closing.notices.size());
    }
    peers.next = 0;
  }
}

// Contacts and ended contacts are each in order of (a, b); merging them gives every host its M4 in that order, too.
void ContactRouter::list_notices() {
  for (UserConnection& peers : state_.user_connections) {
    for (const UserNumber user : peers.notified) {
      state_.users[user].closing.notices.clear();
    }
    peers.notified.clear();
  }
  notices_ = state_.ledger.notices(!state_.nodes_host());
  ended_notices_ = state_.ledger.ended_notices(!state_.nodes_host());
  std::uint32_t next_ended = 0;
  const auto list_ended = [&](std::uint64_t key) {
    for (; next_ended < ended_notices_.size() && ended_notices_[next_ended].key < key; ++next_ended) {
      list_notice(next_ended | PeerSession::Closing::ended, ended_notices_[next_ended].found);
    }
  };
  for (std::uint32_t i = 0; i < notices_.size(); ++i) {
    list_ended(notices_[i].key);
    list_notice(i, notices_[i].found);
  }
  list_ended(~std::uint64_t{0});
}

// CD nodes receive their contacts from each other.
void ContactRouter::list_notice(std::uint32_t notice, const Found& found) {
  const Endpoint first = state_.objects.host(found.a);
  const Endpoint second = state_.objects.host(found.b);
  const auto notify_host = [&](Endpoint host) {
    if (PeerSession* session = host.is_user() ? state_.session_of(host) : nullptr) {
      if (session->closing.notices.empty()) {
        state_.user_connections[session->user_connection].notified.push_back(host.number());
      }
      session->closing.notices.push_back(notice);
    }
  };
  notify_host(first);
  if (second != first) {
    notify_host(second);
  }
}

Contact ContactRouter::contact_of(std::uint32_t notice) const noexcept {
  constexpr std::uint32_t ended = PeerSession::Closing::ended;
  Contact contact;
  ((notice & ended) != 0 ? ended_notices_[notice & ~ended] : notices_[notice]).write(contact);
  return contact;
}

bool ContactRouter::notify(PeerSession& node) {
  const bool exchange = state_.map_change.at_end && state_.map_change.hosts_exchange_objects;
  return (!state_.map_change.at_end || exchange_.send_map(node, node.closing.map_run)) &&
         (exchange_.reads_nodes() || send_resolved(node)) &&
         state_.send(node, node.end_run, MessageType::frame_end, [&](std::size_t) {
           return messages::FrameEndRecord{node.hand_overs, exchange_.announced_contacts(node), exchange ? 1u : 0u, 0};
         });
}

bool ContactRouter::send_resolved(PeerSession& node) {
  PeerSession::Closing& closing = node.closing;
  const auto unlisted = state_.ledger.unlisted(node.self.number());
  const auto corrections = state_.ledger.corrections(node.self.number());
  const auto unlist = [&](std::size_t i) { return messages::UnlistRecord{unlisted[i].key}; };
  const auto correct = [&](std::size_t i) { return messages::CorrectRecord{corrections[i]}; };
  return state_.send(node, closing.unlist_run, MessageType::unlist, unlist) &&
         state_.send(node, closing.correct_run, MessageType::correct, correct);
}

bool ContactRouter::notify_user(PeerSession& user) {
  PeerSession::Closing& closing = user.closing;
  return state_.send(user, closing.notice_run, MessageType::notify,
                     [&](std::size_t i) { return contact_of(closing.notices[i]); });
}

// On each connection first all contacts, then one message to all its users that says so.
bool ContactRouter::notify_users() {
  if (users_are_notified_) {
    return false;
  }
  users_are_notified_ = true;
  for (UserConnection& peers : state_.user_connections) {
    users_are_notified_ &=
        relay_.send_read_publications(peers) &&
        state_.send_to_users(peers, peers.notified, [this](PeerSession& user) { return notify_user(user); }) &&
        state_.send_to_all(peers, peers.end_run, MessageType::notify);
  }
  return true;
}

void ContactRouter::count_contacts() {
  FrameReport& frame = state_.report();
  // Makes accepted differ from tested, so that a duplicate is visible in the report.
  frame.accepted += state_.ledger.duplicates();
  frame.contacts -= state_.ledger.duplicates();
  frame.began = state_.ledger.began();
  exchange_.count_records(statistics_);
}

}  // namespace ringfence::nodes
