#pragma once

#include <cstdint>

#include "base/flat_list.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/cd_node/detector.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/node/node_exchange.hpp"

namespace ringfence::nodes {

/// Makes contacts of a CD node's hits and takes them to their readers: the node's own model, the server, the peers that
/// host their objects, and the output lists.
///
/// Contacts are listed in order of (a, b): lists in this order can be merged, and the host reads its contacts in this
/// order when it moves next. NodeExchange takes them to the other roles.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class ContactPublisher {
 public:
  /// All outlive the publisher.
  ContactPublisher(NodeState& state, const Detector& detector, NodeExchange& exchange);

  /// After Detector::finish(): lists the contacts, compares them with those of the frame before, and starts to send.
  void list();
  /// Sends to the server what it cannot read, and reports that all pairs are tested. Returns whether all is sent; if
  /// not, call it again.
  bool send();
  /// Applies an `unlist` message: these contacts are not in the list of contacts. Precondition: the node found them.
  void unlist(const messages::MessageView& message);
  /// Applies a `correct` message: these contacts persist.
  void receive_corrections(const messages::MessageView& message);
  /// A `notify` message of the server between frames: contacts of the last frame, for objects that were adopted.
  void receive_late(const messages::MessageView& message) { state_.host.contacts().add_late(message); }
  /// After `frame_end`, when the list of contacts and the phases are final: the node's own model gets those that are
  /// listed, with their phases, and the other nodes those that they need.
  void finish();

 private:
  void compare();
  void list_notified_hosts(std::uint32_t position);
  void confirm_begins();

  NodeState& state_;
  const Detector& detector_;
  NodeExchange& exchange_;
  base::FlatList<std::uint32_t> begins_, unlisted_;  ///< scratch
};

}  // namespace ringfence::nodes
