#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/system_vector.hpp"
#include "geometry/shape_table.hpp"
#include "link/doorbell.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/role.hpp"
#include "nodes/server/request.hpp"
#include "ringfence/config.hpp"
#include "ringfence/motion_model.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// Control of the server's frames by the facade: starts a frame and learns of its completion. One frame at a time.
struct FrameOrder {
  base::SystemVector<Request> requests;  ///< for the cut; read by the server while the frame is running
  std::vector<std::byte> states;         ///< of their set_state requests, one after the other
  /// For the CD nodes; empty: none. Kept until the threads of nodes that are lost in this frame have ended.
  std::span<const messages::QueryRecord> queries;
  std::atomic<std::uint64_t> ordered{0};  ///< number of frames ordered; a release store publishes `requests`
  std::atomic<std::uint64_t> completed{0};
  // The last CD node is lost and its work is not done: the server asks the facade for a fallback node in the same slot.
  std::atomic<bool> fallback_wanted{false};
  std::atomic<bool> fallback_ready{false};
  NodeNumber fallback_slot = 0;  ///< valid while wanted
  NodeNumber fallback_id = 0;    ///< valid when ready
  Connection fallback;           ///< the server's end of its connection; valid when ready
  // If user nodes have not reported their moves after half of their deadline, the facade checks their threads. If two
  // checks find a thread in the same move, that user node is late, and the facade moves the others to a new thread.
  std::atomic<bool> users_overdue{false};
  std::atomic<bool> users_moved{false};   ///< the next two lists are valid; reset when the server has read them
  std::vector<UserNumber> stalled_users;  ///< user nodes that are late
  /// A connection with user nodes that another thread steps from now on.
  struct MovedConnection {
    Connection connection;  ///< the server's end
    link::Doorbell* bell;   ///< of the new thread
  };
  std::vector<MovedConnection> moved_connections;
  link::Doorbell* caller = nullptr;  ///< rung when a frame is complete; null if the caller steps the server itself
};

/// Configuration of the server. The pointers outlive the role.
struct ServerSetup {
  const geometry::ShapeTable* shapes = nullptr;
  const geometry::FixedSpace* space = nullptr;
  const MotionModel* model = nullptr;
  Publications* publications = nullptr;
  FrameOrder* order = nullptr;
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  ExchangeKind exchange = ExchangeKind::messages;
  FrameControl* frame_control = nullptr;  ///< with ExchangeKind::shared, the same as that of the nodes
  std::array<std::uint32_t, 32> layer_masks{};
  bool keep_resting = true;  ///< see WorldConfig
  Capacities capacities;
  std::uint32_t deepest_contacts = 0;  ///< WorldConfig::deepest_contacts
  std::size_t contact_frames = 2;      ///< how many frames the ContactLedger keeps
  double interest = 0;
  double sense = 0;  ///< WorldConfig::sense, metres
  /// With more CD nodes, the nodes publish the states of what they host instead of the server.
  std::size_t max_relayed_nodes = 4;
  bool balance = true;  ///< regions follow the load
  BalanceBy balance_by = BalanceBy::cpu_time;
  Quotas quotas;
  bool nodes_may_be_lost = true;  ///< as CdNodeSetup::may_be_lost
  /// A CD node that is silent for this long in a frame, and does not answer a probe, is lost; 0: no deadline.
  std::uint64_t node_deadline_ns = 0;
  /// Time a user node has to report its moves; 0: no deadline. If there is a FrameOrder::caller, the facade finds out
  /// whose move takes too long. Otherwise each user node that has not reported in time is late, and so are all user
  /// nodes of a connection on which `published`, or later `frame_done`, does not arrive in time.
  std::uint64_t user_deadline_ns = 0;
  std::uint64_t first_frame = 0;      ///< not 0 if the world is restored
  telemetry::Track* track = nullptr;  ///< null: no timeline
  std::vector<Connection> nodes;      ///< of the first nodes; the id of each is its slot
};

}  // namespace ringfence::nodes
