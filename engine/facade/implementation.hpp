#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/numbers.hpp"
#include "facade/contact_index.hpp"
#include "facade/duplex_channel.hpp"
#include "facade/node_pool.hpp"
#include "facade/registry.hpp"
#include "facade/remote_nodes.hpp"
#include "facade/worker.hpp"
#include "geometry/shape_table.hpp"
#include "link/cores.hpp"
#include "link/publication.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/frame_inputs.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/server/server_role.hpp"
#include "nodes/user/user_role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/world.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence {

namespace facade {

/// Default size of a ring between the server and a CD node of this process, bytes.
inline constexpr std::size_t server_node_ring = std::size_t{1} << 20;
/// Size of a ring between the server, or a CD node of this process, and a remote node, bytes. It is smaller, so that
/// the network carries the first messages while the server writes the next.
inline constexpr std::size_t remote_node_ring = std::size_t{1} << 16;

/// A thread that steps user nodes, with what it uses for all of them.
struct UserThread {
  nodes::MoveWatch watch;
  nodes::MoveWatch::Move seen = nodes::MoveWatch::none;  ///< the move in which the last check found the thread
  telemetry::StepClock clock;
  telemetry::Track track;
  std::unique_ptr<Worker> worker;  ///< null with nodes = 0
  std::uint64_t cpu_ns = 0;        ///< CPU time that the thread had used at the end of the last frame
};

/// A connected user node, with its channel, publication and role.
struct User {
  /// `server` and `own` are the doorbells of the threads that step the server and the user node; `cells` is the number
  /// of cells of the interest grid.
  User(std::size_t ring_bytes, link::Doorbell* server, link::Doorbell* own, std::size_t cells)
      : channel(ring_bytes, server, own), publication(cells, 64) {}
  DuplexChannel channel;
  link::Publication publication;
  std::unique_ptr<nodes::UserRole> role;
  std::size_t thread = 0;  ///< index of the user thread that steps it
  bool late = false;       ///< it missed its deadline; it gets no further frame
  /// The thread that was abandoned in this user node's move, or null. It steps no other role.
  std::unique_ptr<UserThread> abandoned;
};

}  // namespace facade

/// The state of a World: requests for the next frame, the roles with their channels and threads, and the tables that
/// answer calls. Member functions of Implementation: roles.cpp (server, user nodes, threads), cd_nodes.cpp (CD nodes)
/// and losses.cpp (lost nodes and late user nodes). Member functions of World: requests.cpp (calls that make requests)
/// and world.cpp.
///
/// Threads: used by the thread that calls World. If roles have threads of their own, that thread accesses a role only
/// while no frame is running, or after it has taken the role from its thread.
struct World::Implementation {
  explicit Implementation(WorldConfig given);

  bool threaded() const noexcept { return config.nodes > 0; }
  bool frame_is_running() const noexcept { return begun != frames; }
  std::size_t ring_bytes(std::size_t by_role) const noexcept {
    return config.tuning.ring_bytes != 0 ? config.tuning.ring_bytes : by_role;
  }
  link::Doorbell* server_bell() noexcept { return threaded() ? &server_worker->bell() : nullptr; }

  void build_server();
  [[nodiscard]] bool start_worker(facade::Worker& worker, std::chrono::nanoseconds tick = {});
  void must_start(facade::Worker& worker, std::chrono::nanoseconds tick = {});
  [[noreturn]] void throw_no_thread() const;
  void end_threads() noexcept;
  bool prepare_nodes(std::uint32_t count);
  facade::NodePoolSetup pool_setup();
  facade::PoolChannel connect_to_server(const facade::PoolNode& node, std::size_t count);
  facade::PoolChannel connect_nodes(const facade::PoolNode& first, const facade::PoolNode& second, std::size_t count);
  link::Doorbell* bell_of(const facade::PoolNode& node) noexcept;
  nodes::Request join_request(const facade::PoolNode& node) const;
  void request_partition(std::span<const NodeNumber> leavers);
  void assign_remote_nodes();
  std::vector<facade::Steppable> server_thread_roles();
  void connect_pool();
  void add_arrivals();
  void resize_nodes();
  bool await_frame();
  void fallback();
  void remove_gone_nodes();
  void log_losses() const;
  void list_inline_roles();
  void connect_users();
  void forget_users();
  void part_with_late_users();
  void free_stalled_users();
  nodes::UserThreadParts parts_of(facade::UserThread& thread) const noexcept;
  std::unique_ptr<facade::UserThread> make_user_thread();
  void watch_user_threads();
  void abandon(std::size_t thread);
  void assign_users();
  Status refuse(Status status) noexcept {
    ++refused[static_cast<std::size_t>(status)];
    return status;
  }
  bool can_fail(const Fault& fault) const noexcept;
  Status check_spec(const ObjectSpec& spec) const noexcept;
  /// Whether the object is an avatar of the user.
  Status check_own(UserId user, ObjectId object) const noexcept;
  Status check_layer(std::uint8_t layer) const noexcept {
    return layer < std::max<std::size_t>(1, config.layers.names.size()) ? Status::ok : Status::unknown_layer;
  }
  /// Requests a change of an object unless the status is a refusal, or the object does not exist.
  Status request_change(nodes::Request::Kind kind, ObjectId object, Status status, const ObjectSpec& spec);
  /// The slot of a live object that is in the world, or base::NumberIndex::none; none while a frame is running.
  std::uint32_t slot_of(ObjectId object) const noexcept;
  /// Whether the object exists and may be placed, enabled and disabled.
  Status check_movable(ObjectId object) const noexcept;
  bool is_connected(UserNumber user) const noexcept { return std::binary_search(users.begin(), users.end(), user); }
  bool step_inline();
  /// Call it when memory has run out: no further frame runs. Returns Status::out_of_memory.
  Status stop_frames() noexcept;
  void log(LogLevel level, const std::string& line) const {
    if (config.log) {
      config.log(level, line);
    }
  }
  void log_growth();
  void log_support_failures();
  void gather_model_failures();
  void gather_user_times();
  void gather_timeline();
  /// Whether the node with that id was lost in the last frame.
  bool is_lost(NodeNumber id) const noexcept;

  WorldConfig config;
  geometry::ShapeTable shapes;
  geometry::FixedSpace space;
  std::array<std::uint32_t, 32> layer_masks;  ///< by layer: the layers it collides with
  link::Cores cores;
  std::size_t next_core = 0;
  facade::Registry registry;
  nodes::Publications publications;
  std::unique_ptr<link::Publication> relay;  ///< the server's publication
  link::Doorbell caller_bell;
  nodes::FrameOrder order;
  facade::Halt halt;
  nodes::FaultRelease faults;

  std::vector<nodes::Request> requests;  ///< for the next cut
  std::vector<std::byte> states;         ///< of their set_state requests
  struct PendingMove {
    UserNumber user;
    ObjectNumber number;
    Pose pose;
  };
  std::vector<PendingMove> pending_moves;  ///< for the next frame
  struct PendingInput {
    UserNumber user = no_user_number;
    nodes::ObjectInput input;
  };
  std::vector<PendingInput> pending_inputs;           ///< for the next frame
  std::vector<UserNumber> users;                      ///< connected, or connecting at the next cut; ascending
  std::vector<UserNumber> leaving;                    ///< disconnected; their numbers are in use until the next cut
  std::vector<UserNumber> cut_leaving;                ///< those that the cut of the running frame disconnects
  std::array<std::uint64_t, status_count> refused{};  ///< by status: calls that were refused since the last frame
  std::uint64_t begun = 0;                            ///< number of frames begun
  std::uint64_t frames = 0;                           ///< number of frames completed
  FrameReport report;                                 ///< of the last frame
  telemetry::Track server_track;
  std::uint32_t resize_to = 0;    ///< number of nodes from the frame after the next on; 0: no change
  std::uint32_t resizing_to = 0;  ///< number of nodes from the frame after this one on; 0: no change
  std::optional<std::uint32_t> threads_until_failure;  ///< for tests: number of threads created before one fails
  bool growth_logged = false;
  std::uint32_t model_failures_logged = 0;
  bool failures_logged = false;  ///< of support functions in other processes
  bool halt_logged = false;
  mutable facade::ContactIndex contact_index;
  mutable std::uint64_t indexed_frames = 0;  ///< value of `frames` for which contact_index was built

  // Members are destroyed from the last to the first. All threads end first (`stop`), because they use the roles, the
  // channels and each other's doorbells. Then the roles are freed, and then the channels, which are declared before
  // them.
  std::unique_ptr<facade::Worker> server_worker;
  std::vector<std::unique_ptr<facade::UserThread>> user_threads;
  std::uint64_t user_threads_watched_ns = 0;  ///< time of the last check of the user threads
  std::map<UserNumber, std::unique_ptr<facade::User>> user_nodes;
  std::vector<std::unique_ptr<facade::User>> parted_users;   ///< disconnected; freed when no thread steps them
  std::vector<std::unique_ptr<facade::User>> stalled_users;  ///< disconnected; freed when their threads have ended
  facade::NodePool pool;
  std::unique_ptr<nodes::ServerRole> server;
  std::vector<facade::Steppable> inline_roles;  ///< with nodes = 0: all roles, stepped by the calling thread

  struct ThreadStopper {
    Implementation& world;
    ~ThreadStopper() {
      world.faults.release();
      world.end_threads();
      if (world.config.remote_nodes != nullptr) {
        world.config.remote_nodes->close();
      }
    }
  } stop{*this};
};

}  // namespace ringfence
