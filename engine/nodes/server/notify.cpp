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
  if (setup_.deployment != Deployment::user_collision) {
    return;
  }
  const auto follow = [&](std::uint32_t slot) {
    const Endpoint host = objects_.host(slot);
    if (objects_.alive(slot) && host.is_node()) {
      follow_host(slot, hosting_.node_at(objects_.row(slot).pose.position, map_));
    }
  };
  if (map_changed_ && nodes_exchange_contacts_) {
    // The nodes listed contacts for the next hosts by the map before. Objects that leave by that map may stay by the
    // new.
    for (const std::uint32_t slot : leaving_slots_) {
      note_host_change(slot);
    }
  }
  if (map_changed_ && hosts_exchange_objects_) {
    for (const PeerSession& session : nodes_) {
      if (session.connected) {
        follow_all_hosted(session);
      }
    }
  } else if (map_changed_ || rescan_hosts_) {
    for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
      follow(slot);
    }
  } else {
    constexpr std::size_t ahead = 8;  // they are at random slots
    for (std::size_t i = 0; i < leaving_slots_.size(); ++i) {
      objects_.prefetch_host(leaving_slots_[std::min(i + ahead, leaving_slots_.size() - 1)]);
      follow(leaving_slots_[i]);
    }
  }
}

void ServerRole::follow_host(std::uint32_t slot, NodeNumber next) {
  const NodeNumber host = objects_.host(slot).number();
  if (host != next) {
    hand_overs_.push_back({slot, host, next});
    if (map_changed_ && nodes_exchange_contacts_) {
      note_host_change(slot);
    }
    objects_.set_host(slot, Endpoint::node(next));
    objects_.marks(slot) |= shared_mark;  // the old host knows it, too
    ++nodes_[next].hand_overs;
    ++report().handed_over;
  }
}

// Goes through the objects that the node hosts; the node waits meanwhile. Host-owned states of objects that change
// hosts are stored here: if the next host were lost, no other role would have them.
void ServerRole::follow_all_hosted(const PeerSession& session) {
  const Host& host = *session.connection.node_contacts->host;
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Hosted& hosted = host[i];
    const NodeNumber next = hosting_.node_at(hosted.pose.position, map_);
    if (next != session.self.number()) {
      store_state(session, frame_, hosted.object, hosted.pose, host.state(i));
      follow_host(hosted.object.slot, next);
    }
  }
}

bool ServerRole::send_map(PeerSession& session, messages::RunSender& run) {
  return run.pump(*session.connection.out, head(MessageType::region_map, session.self), sizeof(messages::OwnerRecord),
                  report().traffic, [&](std::size_t i, std::byte* where) {
                    const messages::OwnerRecord record{map_.table()[i], 0};
                    std::memcpy(where, &record, sizeof record);
                  });
}

bool ServerRole::notify(PeerSession& session) {
  link::Sender& out = *session.connection.out;
  auto& counts = report().traffic;
  const bool node = session.self.is_node();
  if (!send_read_publications(session)) {
    return false;
  }
  if (node && map_changed_ && !send_map(session, session.map_run)) {
    return false;
  }
  if (!session.correct_run.done() &&
      !session.correct_run.pump(
          out, head(MessageType::correct, session.self), sizeof(messages::CorrectRecord), counts,
          [&](std::size_t i, std::byte* where) {
            const messages::CorrectRecord record{ledger_.corrections(session.self.number())[i], 0};
            std::memcpy(where, &record, sizeof record);
          })) {
    return false;
  }
  const bool sent =
      session.notice_run.pump(out, head(MessageType::notify, session.self), sizeof(Contact), counts,
                              [&](std::size_t i, std::byte* where) { write_notice(session.notices[i], where); });
  if (!sent || !node) {
    return sent;
  }
  return session.end_run.pump(out, head(MessageType::frame_end, session.self), sizeof(messages::FrameEndRecord), counts,
                              [&](std::size_t, std::byte* where) {
                                const messages::FrameEndRecord record{session.hand_overs};
                                std::memcpy(where, &record, sizeof record);
                              });
}

}  // namespace ringfence::nodes
