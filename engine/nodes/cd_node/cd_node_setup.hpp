#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"
#include "ringfence/motion_model.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// Configuration of a CD node. The pointers outlive the role.
struct CdNodeSetup {
  NodeNumber node = 0;  ///< its slot
  const geometry::ShapeTable* shapes = nullptr;
  const geometry::FixedSpace* space = nullptr;
  const MotionModel* model = nullptr;  ///< null: nothing moves by itself
  double sense = 0;                    ///< WorldConfig::sense, metres
  Placement placement = Placement::server;
  bool hosts = true;  ///< user/collision deployment: the node hosts objects, so it keeps the contacts that it finds
  std::array<std::uint32_t, 32> layer_masks{};  ///< which layers each layer collides with
  bool keep_resting = true;                     ///< see WorldConfig
  bool shares_thread = false;         ///< other roles run on its thread, so its CPU time is measured as busy time
  telemetry::Track* track = nullptr;  ///< null: no timeline
  bool remember_axes = true;          ///< see narrow_phase::NarrowPhase
  /// The node may be lost, so its host-owned states are also copied where the server can read them.
  bool may_be_lost = true;
  ExchangeKind exchange = ExchangeKind::messages;
  std::size_t objects = 0;         ///< number to reserve for
  std::size_t pairs = 0;           ///< number to reserve for
  FaultRelease* faults = nullptr;  ///< ends an injected stop; null: the node stops only between two steps
  /// Object slots are below this number. Checked if the server is in another process.
  std::uint32_t max_slots = std::numeric_limits<std::uint32_t>::max();
  Connection server;
  /// With ExchangeKind::shared: how the server controls the frames of all nodes; outlives the role.
  FrameControl* frame_control = nullptr;
  /// With ExchangeKind::messages, by slot; the node's own entry and those of free slots are empty.
  std::vector<Connection> peers;
  /// With ExchangeKind::shared, by slot; null for free slots, and for all if the node is connected with none.
  std::shared_ptr<const SharedNodes> shared_nodes;

  /// Number of slots.
  std::uint32_t slots() const noexcept {
    return static_cast<std::uint32_t>(shared_nodes != nullptr ? shared_nodes->size() : peers.size());
  }
};

}  // namespace ringfence::nodes
