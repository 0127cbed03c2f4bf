#pragma once

#include <cstddef>
#include <span>

#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Reads the messages of user nodes, checks them, and stores what they contain: states in the object table, reports in
/// Statistics, and in PeerSession::received and UserConnection what has arrived.
///
/// User nodes are not trusted: what they may not send now, or what is not valid, is refused, counted, and reported to
/// the user alone.
///
/// Threads: belongs to the server role.
class UserIngest {
 public:
  UserIngest(ServerState& state, Statistics& statistics) noexcept : state_(state), statistics_(statistics) {}

  /// Reads what the users have sent for which the frame waits. Returns whether there was any message.
  bool receive();

 private:
  bool drain(UserConnection& peers);
  void receive_from_user(UserConnection& peers, std::span<const std::byte> bytes);
  bool receive_from_all(UserConnection& peers, const messages::MessageView& message);
  /// Objects that a user may host beside its avatars.
  std::size_t shared_objects() const noexcept {
    return state_.setup.deployment == Deployment::user ? state_.objects.live() : 0;
  }
  /// `bytes`: size of the message; `valid`: its view, null if it is not valid.
  bool is_over_quota(PeerSession& user, std::size_t bytes, const messages::MessageView* valid);
  void receive(PeerSession& user, const messages::MessageView& message);
  void receive_states(PeerSession& user, const messages::MessageView& message);
  void refuse(PeerSession& user, Status reason, ObjectNumber number = 0);

  ServerState& state_;
  Statistics& statistics_;
};

}  // namespace ringfence::nodes
