// The server's part in the contacts of a frame: which began and ended, and who is told of which.
#include <cstring>

#include "nodes/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

void ServerRole::collect() {
  spend(ringfence::Stage::narrow_phase, telemetry::now_ns());
  ledger_.compare();
  ledger_.share_out();
  FrameReport& frame = report();
  frame.contacts = ledger_.size();
  frame.ended = ledger_.ends();
  spend(ringfence::Stage::collect, telemetry::now_ns());
  change_map();
  next_hosts();
  // Nodes know who hosts the objects next unless the map has changed since they listed what they found.
  peers_tell_ =
      setup_.deployment == Deployment::user_collision && !map_changed_ && !rescan_hosts_ && ledger_.all_share();
  if (!peers_tell_) {
    list_notices();
  }
  all_nodes([&](Party& node) {
    start_telling(node);
    return true;
  });
}

// A node that found the contact itself is told of it by one bit: see ContactLedger::persists, Findings::begun. Of what
// ended nodes are not told: nothing there asks for it.
void ServerRole::list_notice(std::uint32_t notice, const Found& found) {
  const bool ended = (notice & Party::ended) != 0;
  const Endpoint first = objects_.host(found.a);
  const Endpoint second = objects_.host(found.b);
  const auto tell = [&](Endpoint host) {
    if (host.is_node() && (ended || peers_tell_ || host == Endpoint::node(found.by))) {
      return;
    }
    if (Party* party = party_of(host)) {
      party->notices.push_back(notice);
    } else if (host.is_server()) {
      Contact contact;
      write_notice(notice, reinterpret_cast<std::byte*>(&contact));
      host_.add_contact(frame_, contact);
    }
  };
  tell(first);
  if (second != first) {
    tell(second);
  }
}

void ServerRole::write_notice(std::uint32_t notice, std::byte* where) const noexcept {
  Contact contact;
  ((notice & Party::ended) != 0 ? told_ended_[notice & ~Party::ended] : told_[notice]).write(contact);
  std::memcpy(where, &contact, sizeof contact);
}

// Contacts and ended contacts are each in order of (a, b); merging them gives every host its M4 in that order too.
void ServerRole::list_notices() {
  told_ = ledger_.told(!peers_tell_);
  told_ended_ = ledger_.told_ended(!peers_tell_);
  std::uint32_t next_ended = 0;
  const auto list_ended = [&](std::uint64_t key) {
    for (; next_ended < told_ended_.size() && told_ended_[next_ended].key < key; ++next_ended) {
      list_notice(next_ended | Party::ended, told_ended_[next_ended].found);
    }
  };
  for (std::uint32_t i = 0; i < told_.size(); ++i) {
    list_ended(told_[i].key);
    list_notice(i, told_[i].found);
  }
  list_ended(~std::uint64_t{0});
}

void ServerRole::start_telling(Party& party) {
  const bool confirms = party.self.is_node() && setup_.deployment == Deployment::user_collision;
  if (party.line.findings != nullptr) {
    party.line.findings->peers_tell = peers_tell_;
    party.line.findings->hosts_tell = map_changed_ && hosts_tell_;
  }
  party.confirm_run.start(confirms ? ledger_.persists(party.self.number()).size() : 0);
  party.notice_run.start(party.notices.size());
  party.end_run.start(1);
  party.map_run.start(map_.table().size());
}

// Where nodes are told nothing by the server, what users are told is listed while they end.
void ServerRole::start_telling_users() {
  if (peers_tell_) {
    list_notices();
  }
  informed_ = false;
  awaited_users_.clear();
  all_users([&](Party& user) {
    start_telling(user);
    awaited_users_.push_back(user.self.number());
    return true;
  });
}

// The frame is complete. What nodes told each other where they share memory counts like the messages in its place.
void ServerRole::count_contacts() {
  FrameReport& frame = report();
  frame.accepted += ledger_.doubled();  // shows as accepted != tested: never silently
  frame.contacts -= ledger_.doubled();
  frame.began = ledger_.began();
  if (setup_.deployment != Deployment::user_collision) {
    return;
  }
  for (const Party& party : nodes_) {
    if (const Findings* findings = party.line.findings; findings != nullptr && !party.lost) {
      count_shared(Traffic::m2, peers_told_ ? findings->halo.size() : 0, sizeof(messages::PositionRecord));
      count_shared(Traffic::m4, (findings->keys.size() + 63) / 64, sizeof(messages::ConfirmRecord));
      count_shared(Traffic::m4, findings->taken, sizeof(Contact));
    }
  }
}

}  // namespace ringfence::nodes
