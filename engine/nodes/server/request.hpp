#pragma once

#include <cstdint>

#include "base/numbers.hpp"
#include "nodes/role.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// A request for the server's next cut. Checked by the facade; applied in the order of the calls.
struct Request {
  enum class Kind : std::uint8_t {
    connect,
    disconnect,
    spawn,
    destroy,
    place,
    set_enabled,
    add_node,
    retire_node,
    resize
  };

  Kind kind = Kind::spawn;
  ObjectId object;                   ///< spawn, destroy, place, set_enabled
  ObjectSpec spec;                   ///< spawn; place: its pose; set_enabled: whether it is enabled
  UserNumber user = no_user_number;  ///< connect, disconnect
  Connection connection;             ///< connect, add_node
  std::uint32_t nodes = 0;  ///< resize: number of CD nodes from the next frame on; retire_node: the node that leaves
};

}  // namespace ringfence::nodes
