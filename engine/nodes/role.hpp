#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "link/channel.hpp"
#include "messages/header.hpp"

namespace ringfence::nodes {

struct NodeContacts;
struct HostPublication;

/// Result of a role's step. A role never blocks: it does what it can and returns.
enum class Step : std::uint8_t {
  idle,           ///< nothing to do until the next message arrives
  progressed,     ///< some work was done; step again
  blocked,        ///< waits for room in a ring
  out_of_memory,  ///< an allocation failed in the step: the role must not be stepped again
  abandoned,      ///< the World has replaced this thread (see MoveWatch): it ends and steps no role any more
};

/// How the server and the CD nodes of a world exchange typed streams. All of them in the same way, chosen at
/// construction.
enum class ExchangeKind : std::uint8_t {
  messages,  ///< records; between processes, or where a test wants them
  shared,    ///< all roles are in one process: readers read the writer's arrays in place
};

/// One end of the connection between two roles: a sender and a receiver. The channels outlive it.
struct Connection {
  link::Sender* out = nullptr;
  link::Receiver* in = nullptr;
  /// What the CD node shares, with ExchangeKind::shared; otherwise null.
  NodeContacts* node_contacts = nullptr;
  /// The publication of what the CD node hosts, with ExchangeKind::shared, or of what the user nodes of the thread
  /// host. Null for all nodes if users read no states.
  HostPublication* publication = nullptr;
};

/// What the CD nodes of a process share, by slot. One list for all of them.
using SharedNodes = std::vector<NodeContacts*>;

/// Reads all messages from `in`, calls receive(message) for each valid one and refuse() for each other one, and
/// releases the ring space. Returns whether there was any message.
template <class Receive, class Refuse>
bool drain(link::Receiver& in, std::size_t state_bytes, Receive receive, Refuse refuse) {
  bool any = false;
  for (auto bytes = in.next(); !bytes.empty(); bytes = in.next()) {
    messages::MessageView message;
    if (messages::decode(bytes, state_bytes, message) == Status::ok) {
      receive(message);
    } else {
      refuse();
    }
    any = true;
  }
  if (any) {
    in.release();
  }
  return any;
}

}  // namespace ringfence::nodes
