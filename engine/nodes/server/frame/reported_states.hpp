#pragma once

#include <cstddef>
#include <span>

#include "messages/header.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Stores the states that CD nodes report of the objects that they host: in the object table, with what Dispatch and
/// ContactRouter need to know of them.
///
/// Threads: belongs to the server role.
class ReportedStates {
 public:
  ReportedStates(ServerState& state, ObjectStates& states, Statistics& statistics) noexcept
      : state_(state), states_(states), statistics_(statistics) {}

  /// A `node_state` message. Refuses records of objects that the node does not host.
  void receive(PeerSession& node, const messages::MessageView& message);
  /// Prefetches the first records of a message, which has not been checked and may be empty.
  static void prefetch_records(std::span<const std::byte> message) noexcept;
  /// Prefetches the objects of these records, if the message is a `node_state` message.
  void prefetch_objects(std::span<const std::byte> message) const noexcept;
  /// A `replica` message. Returns false at the first record of an object that the node does not host with host-owned
  /// states: then the node has broken the protocol.
  bool receive_replicas(PeerSession& node, const messages::MessageView& message);

 private:
  static constexpr std::size_t ahead = 12;  ///< records that are prefetched before one is received
  void prefetch_object(const messages::MessageView& message, std::size_t i) const noexcept;

  ServerState& state_;
  ObjectStates& states_;
  Statistics& statistics_;
};

}  // namespace ringfence::nodes
