#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ringfence/motion_model.hpp"
#include "ringfence/pose.hpp"

namespace ringfence {

/// Who hosts the objects that are not avatars (section 3 of the paper).
enum class Deployment : std::uint8_t {
  user,            ///< the user nodes, in equal shares
  user_server,     ///< the server hosts active and non-active objects
  user_collision,  ///< the CD node whose region contains the object
};
constexpr const char* name_of(Deployment deployment) noexcept {
  constexpr const char* names[] = {"user", "user-server", "user-collision"};
  return names[static_cast<std::size_t>(deployment)];
}

/// Where the broad phase runs. Candidates and contacts are the same; only the cost differs.
enum class Placement : std::uint8_t {
  server,  ///< the server sweeps all objects and sends each node its candidate pairs
  region,  ///< the server assigns objects to regions; each node sweeps its own region and tests the pairs that it owns
  automatic,  ///< the World chooses at construction: server for one node, region for more; World::config() returns the
              ///< choice
};
constexpr const char* name_of(Placement placement) noexcept {
  constexpr const char* names[] = {"server", "region", "auto"};
  return names[static_cast<std::size_t>(placement)];
}

/// The measure of load by which regions are balanced. Contacts are the same; only the cost differs.
enum class BalanceBy : std::uint8_t {
  cpu_time,  ///< measured CPU time of each node; includes expensive shapes and slow cores
  pairs,     ///< number of pairs that each node tested; gives the same maps in every run on any machine
};
constexpr const char* name_of(BalanceBy by) noexcept {
  constexpr const char* names[] = {"cpu", "pairs"};
  return names[static_cast<std::size_t>(by)];
}

/// Which layers collide. Without names there is one layer, number 0, and everything collides.
struct LayerMatrix {
  std::vector<std::string> names;                              ///< at most 32
  std::vector<std::pair<std::uint8_t, std::uint8_t>> collide;  ///< unordered pairs of layer numbers

  /// Bit mask of the layers that `layer` collides with.
  std::uint32_t mask(std::uint8_t layer) const noexcept;
};

enum class LogLevel : std::uint8_t { debug, info, warning, error };
/// Receives one line without a newline. Called from the thread that calls World, or from the server thread; never
/// concurrently and never by a CD node.
using LogHook = std::function<void(LogLevel, std::string_view)>;

/// Reserved at construction, so that frames do not allocate. A frame that needs more allocates, loses nothing, and
/// reports it: FrameReport::grown, and once through the log hook.
struct Capacities {
  std::size_t objects = 4096;
  std::size_t pairs = 32768;     ///< candidate pairs per frame, all nodes together
  std::size_t contacts = 16384;  ///< per frame
  std::size_t users = 128;
};

/// How long the server waits for others within a frame, in milliseconds; 0: no deadline. Ignored with nodes = 0.
///
/// Choose several times the duration of the longest frame: on a machine with more threads than cores a live node can be
/// silent while the others run.
struct Deadlines {
  /// A CD node that stays silent for this long after it was probed is lost; see FrameReport::lost.
  double node_ms = 0;
  /// Time a user node has to report its moves, and again to acknowledge its contacts. A user node that is late keeps
  /// its old poses in that frame and is disconnected at the next cut; see FrameReport::late. A motion model that does
  /// not return keeps its thread; a new thread steps the other user nodes, whose time starts again.
  double user_ms = 0;
};

/// Limits per user node; 0: no limit. What exceeds them is refused with Status::over_quota and does not slow the others
/// down: the server reads at most 64 KiB of one user node's messages before it serves the others.
struct Quotas {
  std::size_t avatars = 0;  ///< alive at the same time; spawn refuses more
  std::size_t updates = 0;  ///< states in its messages of one frame; the rest is ignored
  /// Of its messages in one frame; further messages are ignored, except that their end-of-frame marks count.
  std::size_t bytes = 0;
};

/// Upper limits of growth; calls beyond them are refused with Status::over_capacity.
struct Limits {
  std::size_t objects = 16'777'216;
  std::size_t users = 65'536;
};

/// CD nodes in other processes, on this machine or others: see ringfence/cluster.hpp in ringfence::dds.
class RemoteNodes;

/// Configuration of a World. The constructor checks all of it and throws Error, which names the field.
struct WorldConfig {
  Vec3d bounds_min{0, 0, 0};  ///< metres; objects may leave the bounds: the outer regions extend to infinity
  Vec3d bounds_max{100, 100, 100};
  std::uint32_t nodes = 1;  ///< CD nodes, 0 to 1024; 0: server, one node and the user nodes run in the calling thread
  std::uint32_t user_threads = 1;  ///< threads that run the user nodes, 1 to 256; ignored with nodes = 0
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  /// Cells on each axis as a power of two, 0 to 10 each; all 0: chosen by the World.
  std::uint32_t cells_log2[3] = {0, 0, 0};
  double interest = 25;  ///< metres around its avatars within which a user node reads the states of others; >= 0
  Capacities capacities;
  Limits limits;
  Deadlines deadlines;
  Quotas quotas;
  std::size_t ring_bytes = 0;  ///< size of every ring; a power of two, 4096 to 2^30; 0: chosen by role
  /// Regions follow the load: the map changes at the end of a frame when the nodes' costs are unequal.
  bool balance = true;
  BalanceBy balance_by = BalanceBy::cpu_time;
  /// The broad phase keeps objects that do not move in a structure of their own; false only for comparison: same
  /// contacts
  bool keep_resting = true;
  bool pin = false;       ///< pin threads to cores if there are enough cores
  bool timeline = false;  ///< fill FrameReport::timeline with what each thread did and when
  /// Nodes remember the axes that separated hulls in earlier frames; affects cost only, contacts are the same.
  bool remember_axes = true;
  LayerMatrix layers;
  std::shared_ptr<const MotionModel> motion;  ///< null: objects move only by World::move and World::place
  LogHook log;                                ///< null: nothing is logged
  /// Null: CD nodes are threads of this process. Otherwise the World's constructor waits for `nodes` remote nodes.
  /// Later nodes are added between frames, up to one per cell and 1024 in all; more wait until there is room. Nodes
  /// that ask to leave are released. When no node is left, the server's thread does their work. Serves one World and
  /// outlives it.
  std::shared_ptr<RemoteNodes> remote_nodes;
};

}  // namespace ringfence
