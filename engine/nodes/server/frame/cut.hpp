#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/dispatch.hpp"
#include "nodes/server/frame/map_scheduler.hpp"
#include "nodes/server/objects/avatar_crowds.hpp"
#include "nodes/server/objects/hosting.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/objects/spawn_order.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// The frame cut: applies the requests that were made before the frame, and assigns a host to each object. FrameOpening
/// then sends every host its changes.
///
/// Threads: belongs to the server role. Allocates for new objects, users and nodes only.
class Cut {
 public:
  Cut(ServerState& state, ServerExchange& exchange, ObjectStates& states, MapScheduler& scheduler, Dispatch& dispatch);

  /// Before the first cut: adds the objects of a save. The first cut gives all of them hosts, which receive their
  /// contacts of the frame before, as after the loss of all nodes. `state_bytes`: size of each state.
  void restore(std::span<const RestoredObject> objects, std::size_t state_bytes);

  // In this order, once a frame.
  /// Ends the frame before: frees the slots of nodes that were lost or have left. Returns whether one was lost.
  bool begin();
  /// Applies the requests of FrameOrder in the order of the calls.
  void apply_requests();
  /// Assigns a host to every object without one, and evens out the users' shares if users came or left.
  void assign_hosts();
  /// Lists the contacts of the frame before for hosts that did not have an object then.
  void list_known_contacts();

 private:
  void apply(const Request& request);
  void connect(const Request& request);
  void disconnect(UserNumber user);
  void end_left_users();
  void spawn(const Request& request);
  void end_object(std::uint32_t slot);
  void place(std::uint32_t slot, const Pose& pose, bool present);
  void add_node(const Request& request);
  void set_slots(std::size_t slots);
  void change(std::uint32_t slot, const Request& request);
  void mark_restored();
  void list_changed();
  void rehost(const HostChange& change);

  ServerState& state_;
  ServerExchange& exchange_;
  ObjectStates& states_;
  MapScheduler& scheduler_;
  Dispatch& dispatch_;
  Hosting hosting_;
  AvatarCrowds crowds_;
  base::SystemVector<PositionedSpawn> spawn_order_;  ///< scratch
  std::vector<std::uint32_t> changed_slots_;         ///< at this cut, by set_group and the like
  bool users_changed_ = false;                       ///< users came or left at this cut
  bool any_left_ = false;                            ///< users left whose objects have not ended yet
  bool spawned_many_ = false;                        ///< at the cut before
  bool restored_ = false;                            ///< no cut was made since restore()
};

}  // namespace ringfence::nodes
