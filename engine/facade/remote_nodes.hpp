#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "facade/threads/steppable.hpp"
#include "geometry/shape_table.hpp"
#include "link/doorbell.hpp"
#include "nodes/role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence {

namespace nodes {
class ServerRole;
}

/// CD nodes in other processes: the interface between a World and its transport (ringfence::dds).
///
/// A World connects the server to a remote node as to any other, by rings, and gives the node's ends of the rings to
/// this object. Its *bridge*, which the server's thread steps after the server, moves messages between these rings and
/// the nodes. So roles do not depend on it, nothing blocks, and connections between threads cost nothing extra.
///
/// Membership changes only between frames, and the World decides: it adds nodes that are ready and removes nodes that
/// were lost or have handed everything over. The bridge itself reports a loss within a frame to the server
/// (ServerRole::lose).
///
/// Threads: the bridge belongs to the server's thread. All other functions are called by the thread that calls World,
/// while no frame is running. One object serves one World and outlives it.
class RemoteNodes {
 public:
  /// A node process; never reused.
  using MemberId = std::uint64_t;
  static constexpr MemberId local_member = 0;  ///< in a NodeAssignment: none, or the node's role is in this process

  /// What every node needs to know of the world besides shapes and regions. The pointers outlive the bridge.
  struct WorldParameters {
    const WorldConfig* config = nullptr;  ///< settled, so placement is not automatic
    std::span<const std::uint32_t> layer_masks;
    std::uint32_t cells_log2[3] = {};
    link::Doorbell* server_bell = nullptr;  ///< to be rung when the bridge has work
  };

  /// Assignment of one slot from the next frame on.
  struct NodeAssignment {
    MemberId member = local_member;
    NodeNumber id = 0;                     ///< of the node
    nodes::Connection server;              ///< the node's end of its connection with the server; empty for local_member
    std::vector<nodes::Connection> peers;  ///< the node's ends of its connections with nodes in this process, by slot
    std::size_t objects = 0;               ///< the node reserves for this many objects
    std::size_t pairs = 0;
  };

  virtual ~RemoteNodes() = default;

  /// Starts to serve the World that `terms` describes. Throws Error on failure.
  virtual void open(const WorldParameters& terms) = 0;
  /// Sends a shape to the nodes, before any message that refers to it.
  virtual void add_shape(ShapeNumber shape, const ShapeDescription& description) = 0;
  /// Removes a shape at the nodes, also at those that join later. No object has it any more.
  virtual void remove_shape(ShapeNumber shape) = 0;
  /// Failures of the motion model that nodes have reported since the last call.
  virtual std::vector<ModelFailure> take_model_failures() = 0;
  /// Waits until `nodes` nodes are ready and returns them. Throws Error with advice if they do not come.
  virtual std::vector<MemberId> wait_for_nodes(std::uint32_t nodes) = 0;
  /// Nodes that are ready and not assigned.
  virtual std::vector<MemberId> arrivals() = 0;
  /// Whether an assigned node has asked to leave.
  virtual bool is_leaving(MemberId member) = 0;
  /// Sets the assigned nodes, by slot, under `map`; nodes that are no longer among them are dismissed. Precondition:
  /// no thread steps the bridge.
  virtual void assign(nodes::ServerRole& server, std::span<const NodeAssignment> assignments,
                      const regions::RegionMap& map) = 0;
  /// The bridge, for the server's thread. Lives as long as this object.
  virtual facade::Steppable bridge() = 0;
  /// Ends the service for the World. Precondition: no thread steps the bridge.
  virtual void close() noexcept = 0;
};

}  // namespace ringfence
