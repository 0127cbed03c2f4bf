#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/bounds.hpp"
#include "nodes/cd_node/halo_exchange.hpp"
#include "nodes/cd_node/migration.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/node/node_exchange.hpp"

namespace ringfence::nodes {

/// Moves the objects that a CD node hosts, batch by batch, and publishes them for the user nodes.
///
/// The changes of a batch are processed while they are in the cache: RegionObjects, HaloExchange and Migration receive
/// them, and NodeExchange reports them to the server while the next batch is moved.
///
/// Threads: belongs to the CD node. Allocates nothing in steady state.
class Mover {
 public:
  /// All outlive the mover.
  Mover(NodeState& state, NodeExchange& exchange, HaloExchange& halo, Migration& migration);

  /// Starts the move of NodeState::frame.
  void begin();
  /// Moves and reports. Returns false if the ring is full; then call it again.
  bool move();
  /// Whether all is moved and reported.
  bool done() const noexcept { return done_; }
  /// Publishes the hosted objects, if the server wants it, while it receives the states of the other nodes. The poses
  /// are final, because they have been reported.
  void publish();

 private:
  /// An object of the batch, before its entry in RegionObjects is replaced.
  struct Placing {
    std::uint32_t hosted;  ///< index in Host
    const Hosted& object;
    const geometry::Bounds& bounds;
    const std::uint32_t* point;
    std::uint32_t was;  ///< index of its entry, or RegionObjects::none
    bool present, was_host_owned;
  };

  void bound_batch();
  void place_batch();
  Placing find(std::size_t i) const noexcept;
  void place(const Placing& moved);
  void rest(const Placing& resting);
  void enter(const Placing& placed, NextHost next, bool inner);

  NodeState& state_;
  NodeExchange& exchange_;
  HaloExchange& halo_;
  Migration& migration_;
  std::span<const std::uint32_t> changed_;  ///< of the last batch: indices in Host; parallel to the next two
  std::array<geometry::Bounds, Host::batch> bounds_;
  std::array<geometry::FixedPoint, Host::batch> points_;  ///< positions
  const bool keeps_;                                      ///< objects are host-owned
  const bool reports_rest_;                               ///< objects that rest are not, and are reported
  const bool lists_next_hosts_;                           ///< NodeState::lists_next_hosts()
  bool done_ = true;
  bool publishes_ = false;  ///< in this frame
};

}  // namespace ringfence::nodes
