#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "facade/steppable.hpp"
#include "geometry/shape_table.hpp"
#include "link/doorbell.hpp"
#include "nodes/role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"

namespace ringfence {

namespace nodes {
class ServerRole;
}

/// CD nodes that are not threads of this process: what a World asks of whoever knows them (ringfence::dds).
///
/// A World with a fleet makes the server's lines to its nodes as to any other: rings, of which the node's ends are
/// given to the fleet. The fleet's *bridge* is stepped by the server's own thread after the server; it carries what it
/// finds in those rings to the nodes, and what comes from the nodes into the rings. So the roles know nothing of it,
/// nothing blocks, and the way between threads costs what it did.
///
/// Who is in the fleet changes between frames only, and the World decides: it takes in those that are ready, and lets
/// those go that were lost or have handed everything over. Loss within a frame the bridge tells the server itself
/// (ServerRole::lose).
///
/// Threads: all but the bridge by the thread that calls World, while no frame is under way; the bridge by the server's.
/// One fleet serves one World, and outlives it.
class RemoteNodes {
 public:
  /// A process that is, or was, a node; never used twice.
  using MemberId = std::uint64_t;
  static constexpr MemberId local_member = 0;  ///< in a Seat: the node's role is in this process

  /// What every node needs to know of the world besides shapes and regions. The pointers outlive the fleet's bridge.
  struct WorldParameters {
    const WorldConfig* config = nullptr;  ///< settled: placement is not automatic
    std::span<const std::uint32_t> layer_masks;
    std::uint32_t cells_log2[3] = {};
    link::Doorbell* server_bell = nullptr;  ///< to be rung when the bridge has something to do
  };

  /// The place of one CD node, by its number, as it is from the next frame on.
  struct NodeAssignment {
    MemberId member = local_member;
    nodes::Connection server;              ///< the node's end of its line with the server; empty for nobody
    std::vector<nodes::Connection> peers;  ///< the node's ends of its lines with those in this process, by number
    std::size_t objects = 0;               ///< that the node is to reserve for
    std::size_t pairs = 0;
  };

  virtual ~RemoteNodes() = default;

  /// A World is being made, as `terms` says. Throws Error where it cannot be.
  virtual void open(const WorldParameters& terms) = 0;
  /// Tells the nodes of a shape, before any message that speaks of it.
  virtual void add_shape(ShapeNumber shape, const ShapeDescription& description) = 0;
  /// Waits until `nodes` are ready and answers which; throws Error, saying what to look at, when they do not come.
  virtual std::vector<MemberId> await(std::uint32_t nodes) = 0;
  /// Those that are ready and have no seat.
  virtual std::vector<MemberId> arrivals() = 0;
  /// Whether one with a seat has asked to leave.
  virtual bool is_leaving(MemberId member) = 0;
  /// From now on these are the nodes, by number, under `map`; who is not among them any more is dismissed. No thread
  /// steps the bridge.
  virtual void assign(nodes::ServerRole& server, std::span<const NodeAssignment> assignments,
                      const regions::RegionMap& map) = 0;
  /// What the server's thread steps. Lives as long as the fleet.
  virtual facade::Steppable bridge() = 0;
  /// The World is going. No thread steps the bridge.
  virtual void close() noexcept = 0;
};

}  // namespace ringfence
