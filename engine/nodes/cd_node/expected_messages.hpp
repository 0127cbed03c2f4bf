#pragma once

#include "messages/header.hpp"
#include "nodes/cd_node/migration.hpp"
#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

/// Decides which messages of other processes a CD node accepts: those that the protocol allows at this stage of the
/// frame, and whose records name only what the node knows. Messages of the same process are not checked.
///
/// Threads: belongs to the CD node. Changes nothing; allocates only for the last part of a region map.
class ExpectedMessages {
 public:
  /// Both outlive this object.
  ExpectedMessages(const NodeState& state, const Migration& migration) : state_(state), migration_(migration) {}

  /// Whether the message comes from another node that was lost: such a node may still send in this frame or in later
  /// ones. Such messages are ignored; they are no error.
  bool is_late(const messages::MessageView& message) const noexcept;
  /// Whether the protocol allows the message now. If not, its sender is faulty.
  bool is_acceptable(const messages::MessageView& message) const;

 private:
  bool is_expected(const messages::MessageView& message) const;
  bool is_loss_expected(const messages::MessageView& message) const noexcept;
  bool is_map_expected(const messages::MessageView& message) const;
  bool knows_pairs(const messages::MessageView& message) const noexcept;
  bool knows_contacts(const messages::MessageView& message) const noexcept;

  const NodeState& state_;
  const Migration& migration_;
};

}  // namespace ringfence::nodes
