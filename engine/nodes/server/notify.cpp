// Hosts of the next frame, and the messages that notify hosts of contacts.
#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/server/server_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

// In user/collision deployment the hosts follow the poses and the region map. The nodes conclude the same from their
// own data; the server needs it to route contacts and to count the hand-overs that each node must expect.
void ServerRole::next_hosts() {
  if (state_.setup.deployment != Deployment::user_collision) {
    return;
  }
  const auto follow = [&](std::uint32_t slot) {
    const Endpoint host = state_.objects.host(slot);
    if (state_.objects.alive(slot) && host.is_node()) {
      follow_host(slot, hosting_.node_at(state_.objects.row(slot).pose.position, state_.map));
    }
  };
  if (state_.map_change.at_end && nodes_exchange_contacts_) {
    // The nodes listed contacts for the next hosts by the map before. Objects that leave by that map may stay by the
    // new.
    for (const std::uint32_t slot : state_.leaving_slots) {
      state_.note_host_change(slot);
    }
  }
  if (state_.map_change.at_end && state_.map_change.hosts_exchange_objects) {
    for (const PeerSession& session : state_.nodes) {
      if (session.connected) {
        follow_all_hosted(session);
      }
    }
  } else if (state_.map_change.at_end || state_.map_change.rescan_hosts) {
    for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
      follow(slot);
    }
  } else {
    constexpr std::size_t ahead = 8;  // they are at random slots
    for (std::size_t i = 0; i < state_.leaving_slots.size(); ++i) {
      state_.objects.prefetch_host(state_.leaving_slots[std::min(i + ahead, state_.leaving_slots.size() - 1)]);
      follow(state_.leaving_slots[i]);
    }
  }
}

void ServerRole::follow_host(std::uint32_t slot, NodeNumber next) {
  const NodeNumber host = state_.objects.host(slot).number();
  if (host != next) {
    state_.hand_overs.push_back({slot, host, next});
    if (state_.map_change.at_end && nodes_exchange_contacts_) {
      state_.note_host_change(slot);
    }
    state_.objects.set_host(slot, Endpoint::node(next));
    state_.objects.marks(slot) |= shared_mark;  // the old host knows it, too
    ++state_.nodes[next].closing.hand_overs;
    ++state_.report().handed_over;
  }
}

// Goes through the objects that the node hosts; the node waits meanwhile. Host-owned states of objects that change
// hosts are stored here: if the next host were lost, no other role would have them.
void ServerRole::follow_all_hosted(const PeerSession& session) {
  const Host& host = *SharedNodes::host_of(session);
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Hosted& hosted = host[i];
    const NodeNumber next = hosting_.node_at(hosted.pose.position, state_.map);
    if (next != session.self.number()) {
      states_.store(session, state_.frame, hosted.object, hosted.pose, host.state(i));
      follow_host(hosted.object.slot, next);
    }
  }
}

bool ServerRole::notify(PeerSession& session) {
  link::Sender& out = *session.connection.out;
  auto& counts = state_.report().traffic;
  const bool node = session.self.is_node();
  if (!relay_.send_read_publications(session)) {
    return false;
  }
  if (node && state_.map_change.at_end && !state_.send_map(session, session.closing.map_run)) {
    return false;
  }
  if (!session.closing.correct_run.done() &&
      !session.closing.correct_run.pump(
          out, state_.head(MessageType::correct, session.self), sizeof(messages::CorrectRecord), counts,
          [&](std::size_t i, std::byte* where) {
            const messages::CorrectRecord record{state_.ledger.corrections(session.self.number())[i], 0};
            std::memcpy(where, &record, sizeof record);
          })) {
    return false;
  }
  const bool sent = session.closing.notice_run.pump(
      out, state_.head(MessageType::notify, session.self), sizeof(Contact), counts,
      [&](std::size_t i, std::byte* where) { write_notice(session.closing.notices[i], where); });
  if (!sent || !node) {
    return sent;
  }
  return session.closing.end_run.pump(out, state_.head(MessageType::frame_end, session.self),
                                      sizeof(messages::FrameEndRecord), counts, [&](std::size_t, std::byte* where) {
                                        const messages::FrameEndRecord record{session.closing.hand_overs};
                                        std::memcpy(where, &record, sizeof record);
                                      });
}

}  // namespace ringfence::nodes
