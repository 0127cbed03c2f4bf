#pragma once

#include "messages/header.hpp"
#include "nodes/cd_node/migration.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/cd_node/peer_inbox.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "nodes/message_check.hpp"

namespace ringfence::nodes {

/// Decides which messages a CD node accepts: from the server those that the protocol allows at this stage of the frame,
/// and whose records name only what the node knows; from other nodes those of the present step. Without need if
/// NodeExchange::trusts_senders(), except for judge().
///
/// Threads: belongs to the CD node. Changes nothing; allocates only for the last part of a region map.
class ExpectedMessages {
 public:
  /// All outlive this object.
  ExpectedMessages(const NodeState& state, const NodeExchange& exchange, const Migration& migration)
      : state_(state), exchange_(exchange), migration_(migration) {}

  /// What to do with a message of another CD node. Messages of lost nodes, which may still send, and those of an
  /// earlier epoch are dropped; messages for a later step, frame or epoch wait.
  PeerInbox::Verdict judge(const messages::MessageView& message) const noexcept;
  /// Whether another CD node may send such a message at all. If not, its sender is faulty.
  bool is_from_peer(const messages::MessageView& message) const noexcept;
  /// Whether the protocol allows a message of the server now. If not, the server is faulty.
  bool is_acceptable(const messages::MessageView& message) const;

 private:
  MessageLimits limits() const noexcept;
  bool is_expected(const messages::MessageView& message) const;
  bool is_loss_expected(const messages::MessageView& message) const noexcept;
  bool is_map_expected(const messages::MessageView& message) const;
  bool knows_shapes(const messages::MessageView& message) const noexcept;
  bool knows_pairs(const messages::MessageView& message) const noexcept;
  bool knows_contacts(const messages::MessageView& message) const noexcept;
  bool knows_positions(const messages::MessageView& message) const noexcept;

  const NodeState& state_;
  const NodeExchange& exchange_;
  const Migration& migration_;
};

}  // namespace ringfence::nodes
