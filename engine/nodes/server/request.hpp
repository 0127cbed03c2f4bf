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
    set_group,
    set_layer,
    set_shape,
    set_state,
    add_node,     ///< a CD node takes a free slot
    retire_node,  ///< the CD node hands everything over at the end of the frame
    partition     ///< at the end of the frame all cells are divided again among the CD nodes that stay
  };

  Kind kind = Kind::spawn;
  ObjectId object;                   ///< spawn, destroy, place, set_*
  ObjectSpec spec;                   ///< spawn; of place and set_* only what they change
  std::uint32_t state = 0;           ///< set_state: position of the new state in FrameOrder::states
  UserNumber user = no_user_number;  ///< connect, disconnect
  Connection connection;             ///< connect, add_node
  NodeNumber node = 0;               ///< add_node, retire_node: its slot
  NodeNumber node_id = 0;            ///< add_node
};

}  // namespace ringfence::nodes
