#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/contacts/contact_router.hpp"
#include "nodes/server/frame/cut.hpp"
#include "nodes/server/frame/dispatch.hpp"
#include "nodes/server/frame/frame_opening.hpp"
#include "nodes/server/frame/map_scheduler.hpp"
#include "nodes/server/frame/node_ingest.hpp"
#include "nodes/server/frame/state_relay.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/frame/user_ingest.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/recovery/deadlines.hpp"
#include "nodes/server/recovery/failover.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// The collision detection server: one per world. It cuts the stream of requests into frames, receives the objects'
/// states, sweeps (broad phase), assigns pairs to CD nodes, collects their contacts, and notifies the hosts of the
/// objects. In user/server deployment it also hosts the active and non-active objects.
///
/// This class is the state machine of the frame: step() reads messages and makes the transitions of FrameStage, each of
/// which calls the steps of the parts. The steps are those of docs/architecture.md. Nodes come first: the server starts
/// and notifies the users while the nodes already work.
///
/// A CD node has a slot from the cut at which it joins to the cut after it was lost or has left. Then the slot is free,
/// and another node may take it. The region map, messages and all arrays by node use slots; reports use ids.
///
/// Threads: one thread at a time steps it. Never blocks, never throws; does not allocate in steady state.
class ServerRole {
 public:
  ServerRole(const ServerSetup& setup, const regions::RegionMap& map);

  Step step();

  /// Marks the CD node in a slot as lost: it missed its deadline (detected by the role itself), or its link was closed.
  /// Other nodes take over its regions, its objects and its pairs of the frame; see Failover. Called by the thread
  /// that steps the role. Returns false and does nothing while no frame is running; call it again within the next
  /// frame.
  bool lose(NodeNumber node);

  /// Whether the CD node that was in the slot in the last frame was lost in it because it broke the protocol. Call
  /// between frames.
  bool is_broken(NodeNumber node) const noexcept { return node < state_.nodes.size() && state_.nodes[node].broken; }

  /// Before the first frame, whose number is ServerSetup::first_frame: the world continues with these objects and the
  /// contacts of the frame before. Of the contacts only what the objects do not state is read: numbers, phase, depth,
  /// normal, toi and point. They are in order of (a, b), and between these objects.
  void restore(std::span<const RestoredObject> objects, std::size_t state_bytes, std::span<Contact> contacts);

  // Between frames, for the facade.
  /// Sets what wakes the threads of all CD nodes at once; null: each node is woken by itself. While no thread steps the
  /// role.
  void set_wake_tree(std::shared_ptr<link::WakeTree> tree) noexcept { state_.wake_tree = std::move(tree); }
  /// Whether the CD node in the slot has handed everything over, as Request::retire_node asked, so that the slot is
  /// free at the next cut. If a node is lost in the same frame, the request may have no effect.
  bool has_left(NodeNumber node) const noexcept { return node < state_.nodes.size() && state_.nodes[node].left; }
  const regions::RegionMap& map() const noexcept { return state_.map; }
  /// Poses and states of host-owned objects (host_owned_mark) may be of an earlier frame: see pose().
  const ObjectTable& objects() const noexcept { return state_.objects; }
  const geometry::ShapeTable& shapes() const noexcept { return *state_.setup.shapes; }
  /// The space of the bounds of all roles.
  const geometry::FixedSpace& space() const noexcept { return *state_.setup.space; }
  /// Whether ObjectTable::bounds() are those of the last frame, for objects that are not in the memory of a host.
  bool has_bounds() const noexcept { return !states_.has_stale_bounds(); }
  /// Pose of the live object in that slot after the last frame.
  const Pose& pose(std::uint32_t slot) const noexcept { return states_.pose(slot); }
  /// Whether the pose of an object is not in the table.
  bool is_in_host(std::uint32_t slot) const noexcept { return states_.is_in_host(slot); }
  // As those of ObjectStates.
  bool reads_hosts() const noexcept { return states_.reads_hosts(); }
  template <class Visit>
  void each_in_node(Visit visit) const {
    states_.each_in_node(visit);
  }
  /// The model's state of the same: ObjectTable::state_bytes() bytes, valid until the next frame.
  const std::byte* state(std::uint32_t slot) const noexcept { return states_.state(slot); }
  /// Lists what the CD nodes answered to the queries of the last frame (FrameOrder::queries). Returns false if that is
  /// not complete, because a node was lost.
  bool list_answers(std::vector<const NodeQueries*>& answers) const;
  /// Why the model threw in the last frame, for objects that were spawned or that the server moved.
  const ModelFailures& model_failures() const noexcept { return state_.model_failures; }
  // For the last frame; unchanged while the next one is running.
  const ContactLedger& ledger() const noexcept { return state_.ledger; }
  /// Whether all nodes of the last frame were lost because the thread of one had stopped inside a read gate.
  bool has_abandoned_nodes() const noexcept { return deadlines_.has_abandoned_nodes(); }
  /// Precondition: the threads of all lost nodes have ended.
  void free_abandoned() noexcept {
    state_.ledger.free_abandoned();
    exchange_->free_abandoned();
  }
  const FrameReport& report(std::uint64_t frame) const noexcept { return state_.reports[frame & 1]; }

 private:
  void cut();
  bool advance();
  bool advance_stage();
  void prepare_dispatch();
  void detect();
  void assign_next_hosts_early();
  void finish();

  // What the parts share.
  ServerState state_;
  Statistics statistics_;
  const std::unique_ptr<ServerExchange> exchange_;
  ObjectStates states_;
  // The parts, in the order of a frame.
  Dispatch dispatch_;
  MapScheduler scheduler_;
  Cut cut_;
  FrameOpening opening_;
  StateRelay relay_;
  NodeIngest node_ingest_;
  UserIngest user_ingest_;
  ContactRouter router_;
  Failover failover_;
  Deadlines deadlines_;
  std::uint64_t frames_;              ///< frames begun, also before the world was restored
  bool next_hosts_assigned_ = false;  ///< in this frame, before the contacts are known
};

}  // namespace ringfence::nodes
