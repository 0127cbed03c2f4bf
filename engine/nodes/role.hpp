#pragma once

#include <cstddef>
#include <cstdint>

#include "link/channel.hpp"
#include "messages/header.hpp"

namespace ringfence::nodes {

struct NodeContacts;
struct NodePublication;

/// What a role's step answers. A role never blocks: it does what it can and says how it stands.
enum class Step : std::uint8_t {
  idle,        ///< nothing to do until a message arrives
  progressed,  ///< something was done; step again
  blocked,     ///< waits for room in a link
};

/// Both directions of the way between two roles, seen from one of them. The channels outlive it.
struct Connection {
  link::Sender* out = nullptr;
  link::Receiver* in = nullptr;
  NodeContacts* node_contacts =
      nullptr;  ///< of the CD node, shared; null where it is in another process than the server
  NodePublication* publication = nullptr;  ///< in which such a node tells what it hosts; null: the server relays it
};

/// Takes all that has come over `in`, shows receive(message) what decodes, and gives the room back. Whether there was
/// anything.
template <class Receive>
bool drain(link::Receiver& in, std::size_t state_bytes, Receive receive) {
  bool any = false;
  for (auto bytes = in.next(); !bytes.empty(); bytes = in.next()) {
    messages::MessageView message;
    if (messages::decode(bytes, state_bytes, message) == Status::ok) {
      receive(message);
    }
    any = true;
  }
  if (any) {
    in.release();
  }
  return any;
}

}  // namespace ringfence::nodes
