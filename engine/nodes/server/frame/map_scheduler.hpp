#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/map_planner.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"
#include "regions/balance.hpp"

namespace ringfence::nodes {

/// Plans region maps: regions follow the load, and a changed number of nodes gets a new map.
///
/// Contacts do not depend on the map, only the nodes' costs do. A map is planned over several frames: first the objects
/// and contacts are weighed, a slice per frame, while the nodes test and the server would wait; then another thread
/// computes the map (MapPlanner). It is adopted a fixed number of frames later, so that the maps of a run do not depend
/// on how fast that thread is. Only when the number of nodes changes, everything is done at once. A new map is adopted
/// at the end of a frame without a loss. See regions/balance.hpp for the method.
///
/// Threads: belongs to the server role. Memory: that of regions::Balance.
class MapScheduler {
 public:
  MapScheduler(ServerState& state, const ServerExchange& exchange, ObjectStates& states);

  /// At the end of this frame, or of the first one without a loss, all cells are divided among the nodes that stay.
  void request_partition() noexcept { partition_due_ = true; }
  /// While the nodes test and their objects do not move: does one step of planning. Returns false if there was none.
  /// May wait for the map.
  bool plan();
  /// After plan(): whether change_map() adopts a new map in this frame, unless a node is lost.
  bool is_map_due() const noexcept {
    return partition_due_ || (plan_.pass == Plan::Pass::planned && is_for_current_map());
  }
  /// When the contacts of the frame are known: adopts a new map for the next frame, if one is due, and compares the
  /// costs of the nodes. Sets ServerState::map_change, PeerSession::left and PeerSession::leaving.
  void change_map();
  /// At the end of a frame: sets ServerState::map_change for the next. If all nodes that stay were lost after the cells
  /// were divided among them, one of those that leave stays.
  void finish() noexcept;
  /// The cost of a node in a frame, in ms, by the measure that the setup names.
  static double cost_of(const ServerSetup& setup, const NodeReport& node) noexcept;

 private:
  /// State of the planning of a new map.
  struct Plan {
    enum class Pass : std::uint8_t { none, weighing, computing, planned };
    Pass pass = Pass::none;
    std::uint32_t epoch = 0;               ///< of the map to be replaced
    std::size_t slots = 0;                 ///< of nodes, at that time
    std::size_t part = 0, next = 0;        ///< next objects or contacts to weigh
    std::size_t frames_left = 0;           ///< computing: until the map is taken
    std::span<const std::uint32_t> table;  ///< the new map
  };

  void compare_costs();
  void adopt(std::span<const std::uint32_t> table);
  void note_renotified() noexcept;
  bool is_for_current_map() const noexcept;
  void begin_weights();
  void cancel();
  std::size_t slice() const noexcept;
  bool weigh(std::size_t most);
  std::size_t weigh_part(std::size_t part, std::size_t first, std::size_t end);
  bool is_readable(messages::Endpoint host) const noexcept;
  std::span<const std::uint32_t> partition();
  void keep_last_node() noexcept;

  ServerState& state_;
  const ServerExchange& exchange_;
  ObjectStates& states_;
  regions::Balance balance_;
  MapPlanner planner_{balance_};
  std::vector<regions::NodeCost> costs_;  ///< of the nodes in the frame before
  Plan plan_;
  bool partition_due_ = false;
  std::vector<NodeNumber> remaining_;  ///< ServerState::list_remaining_nodes()
};

}  // namespace ringfence::nodes
