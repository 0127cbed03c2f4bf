// The server's work on the contacts of a frame: phases, and which hosts are notified of which contacts.
#include <cstring>

#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

void ServerRole::collect() {
  statistics_.charge(Stage::narrow_phase);
  state_.ledger.resolve_phases();
  state_.ledger.share_out();
  FrameReport& frame = state_.report();
  frame.contacts = state_.ledger.size();
  frame.ended = state_.ledger.ends();
  statistics_.charge(Stage::collect);
  nodes_exchange_contacts_ = state_.setup.deployment == Deployment::user_collision && state_.ledger.all_share();
  scheduler_.change_map();
  next_hosts();
  if (!nodes_exchange_contacts_) {
    list_notices();
  }
  state_.all_nodes([&](PeerSession& node) {
    start_notifying(node);
    return true;
  });
}

// Not listed for the node that found the contact. Nodes are not notified of ended contacts, because models do not use
// them. The server, as a host, reads the output lists.
void ServerRole::list_notice(std::uint32_t notice, const Found& found) {
  const bool ended = (notice & PeerSession::Closing::ended) != 0;
  const Endpoint first = state_.objects.host(found.a);
  const Endpoint second = state_.objects.host(found.b);
  const auto notify_host = [&](Endpoint host) {
    if (host.is_node() && (ended || nodes_exchange_contacts_ || host == Endpoint::node(found.by))) {
      return;
    }
    if (PeerSession* session = state_.session_of(host)) {
      session->closing.notices.push_back(notice);
    }
  };
  notify_host(first);
  if (second != first) {
    notify_host(second);
  }
}

void ServerRole::write_notice(std::uint32_t notice, std::byte* where) const noexcept {
  Contact contact;
  ((notice & PeerSession::Closing::ended) != 0 ? ended_notices_[notice & ~PeerSession::Closing::ended]
                                               : notices_[notice])
      .write(contact);
  std::memcpy(where, &contact, sizeof contact);
}

// Contacts and ended contacts are each in order of (a, b); merging them gives every host its M4 in that order, too.
void ServerRole::list_notices() {
  notices_ = state_.ledger.notices(!nodes_exchange_contacts_);
  ended_notices_ = state_.ledger.ended_notices(!nodes_exchange_contacts_);
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

void ServerRole::start_notifying(PeerSession& session) {
  SharedNodes::set_exchange(session, nodes_exchange_contacts_,
                            state_.map_change.at_end && state_.map_change.hosts_exchange_objects);
  if (session.self.is_node() && !state_.ledger.corrections(session.self.number()).empty()) {
    session.closing.correct_run.start(state_.ledger.corrections(session.self.number()).size());
  }
  session.closing.notice_run.start(session.closing.notices.size());
  session.closing.end_run.start(1);
  session.closing.map_run.start(state_.map.table().size());
}

// If the server does not notify nodes, the notices for users are listed here, while the nodes end.
void ServerRole::start_notifying_users() {
  if (nodes_exchange_contacts_) {
    list_notices();
  }
  users_are_notified_ = false;
  state_.awaited_users.clear();
  state_.all_users([&](PeerSession& user) {
    start_notifying(user);
    state_.awaited_users.push_back(user.self.number());
    return true;
  });
}

// The frame is complete. What nodes exchanged through shared memory counts like the messages that it replaces.
void ServerRole::count_contacts() {
  FrameReport& frame = state_.report();
  // Makes accepted differ from tested, so that a duplicate is visible in the report.
  frame.accepted += state_.ledger.duplicates();
  frame.contacts -= state_.ledger.duplicates();
  frame.began = state_.ledger.began();
  shared_.count_reads(statistics_);
}

}  // namespace ringfence::nodes
