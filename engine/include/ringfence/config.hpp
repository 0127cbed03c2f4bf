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
#include "ringfence/recorder.hpp"
#include "ringfence/shape.hpp"
#include "ringfence/tuning.hpp"

namespace ringfence {

/// Which role hosts active and non-active objects. The deployments are those of section 3 of Morgan and Storey 2005;
/// see docs/paper-map.md. An avatar is always hosted by its user node, and a static object has no host.
enum class Deployment : std::uint8_t {
  user,            ///< the user nodes, in equal shares; the server while no user node is connected
  user_server,     ///< the server
  user_collision,  ///< the CD node whose region contains the position of the object
};
/// Name of a deployment in options and reports.
constexpr const char* name_of(Deployment deployment) noexcept {
  constexpr const char* names[] = {"user", "user-server", "user-collision"};
  return names[static_cast<std::size_t>(deployment)];
}

/// Where the broad phase runs. Candidates and contacts are the same for all values; only the cost differs.
enum class Placement : std::uint8_t {
  server,  ///< the server sweeps all objects and sends each node its candidate pairs
  region,  ///< the server assigns objects to regions; each node sweeps its own region and tests the pairs that it owns
  /// The World chooses at construction: `server` if WorldConfig::nodes is 1, else `region`. World::config() returns the
  /// choice.
  automatic,
};
/// Name of a placement in options and reports.
constexpr const char* name_of(Placement placement) noexcept {
  constexpr const char* names[] = {"server", "region", "auto"};
  return names[static_cast<std::size_t>(placement)];
}

/// The measure of load by which regions are balanced. Contacts are the same for all values; only the cost differs.
enum class BalanceBy : std::uint8_t {
  cpu_time,  ///< measured CPU time of each node; takes expensive shapes and slow cores into account
  pairs,     ///< number of pairs that each node tested; gives the same maps in every run on any machine
};
/// Name of a measure of load in options and reports.
constexpr const char* name_of(BalanceBy by) noexcept {
  constexpr const char* names[] = {"cpu", "pairs"};
  return names[static_cast<std::size_t>(by)];
}

/// Which layers collide. Without names there is one layer, number 0, whose objects all collide with each other.
struct LayerMatrix {
  std::vector<std::string> names;  ///< of layers 0, 1, ...; at most 32
  /// Pairs of layers that collide, in either order. Objects of layer i collide with each other only if the list has
  /// {i, i}.
  std::vector<std::pair<std::uint8_t, std::uint8_t>> collide;

  /// Bit mask of the layers that `layer` collides with: bit i is layer i.
  std::uint32_t mask(std::uint8_t layer) const noexcept;
};

enum class LogLevel : std::uint8_t { debug, info, warning, error };
/// "debug", "info", "warning", "error".
constexpr const char* name_of(LogLevel level) noexcept {
  constexpr const char* names[] = {"debug", "info", "warning", "error"};
  return names[static_cast<std::size_t>(level)];
}
/// Receives one line of the log, without a newline. It is called on the thread that calls World or on the server's
/// thread, never on the thread of a CD node, and never concurrently. The line is valid during the call.
using LogHook = std::function<void(LogLevel, std::string_view)>;

/// The sizes for which the World reserves memory at construction, so that frames do not allocate; each is at least 1. A
/// frame that needs more allocates memory and loses nothing. If it needs more objects, pairs or contacts,
/// FrameReport::grown counts this, and the log hook receives one line about the first such frame.
struct Capacities {
  std::size_t objects = 4096;    ///< at most Limits::objects
  std::size_t pairs = 32768;     ///< candidate pairs per frame, all nodes together
  std::size_t contacts = 16384;  ///< per frame
  std::size_t users = 128;       ///< at most Limits::users
};

/// How long the server waits for other roles within a frame, in milliseconds; 0: no deadline. Ignored with nodes = 0.
///
/// Choose several times the duration of the longest frame: on a machine with more threads than cores, a live node can
/// be silent while other threads run.
struct Deadlines {
  /// If the server has received nothing from a CD node for half of this time, it sends the node a probe. If it receives
  /// nothing in the other half either, the node is lost; see FrameReport::lost.
  double node_ms = 0;
  /// Time that a user node has to report its moves. It is late if its motion model does not return in time: its objects
  /// keep their old poses in that frame, and it is disconnected at the next cut; see FrameReport::late. A new thread
  /// steps the other user nodes of the same thread; their time starts again. A user node that has reported its moves is
  /// not late in that frame.
  double user_ms = 0;
};

/// Limits for each user, so that one user cannot slow down all; 0: no limit. The excess is refused with
/// Status::over_quota, and counted in World::refused() of that user and in FrameReport::refused. With or without
/// quotas, a user node that sends many messages does not delay the others: the server reads at most 64 KiB of its
/// messages before it continues with the next user node.
struct Quotas {
  std::size_t avatars = 1024;  ///< number of its avatars that are alive at the same time; spawn refuses more
  /// Number of its avatars that collide with each other: if it has more, those with the lowest numbers, fixed at the
  /// cut; a disabled avatar counts. So one user cannot make contacts that are the square of its avatars. All pairs of
  /// its avatars with objects of others stand.
  std::size_t colliding_avatars = 32;
  /// Number of states in its messages of one frame; further states are ignored. With Deployment::user it may send as
  /// many more as the world has objects.
  std::size_t updates = 4096;
  /// Size of its messages in one frame; further messages are ignored, except for the mark that ends its states or its
  /// frame. With Deployment::user it may send 512 more for each object of the world.
  std::size_t bytes = std::size_t{1} << 21;
  std::size_t spawns = 4096;   ///< calls of spawn for its avatars in each window
  std::size_t moves = 262144;  ///< calls of move and input together in each window
  /// Length of a window in frames, at least 1: windows begin with frames 0, `window`, 2 * `window`, ...
  std::size_t window = 60;
};

/// How much a World can grow. Calls that exceed a limit are refused with Status::over_capacity.
struct Limits {
  std::size_t objects = 16'777'216;  ///< number of live objects
  std::size_t users = 65'536;        ///< user numbers are less than this
};

/// CD nodes in other processes, on this machine or on others. Created by the library ringfence::dds, see
/// ringfence/cluster.hpp.
class RemoteNodes;

/// Configuration of a World. The constructor of World checks all fields and throws Error, which names the invalid one.
struct WorldConfig {
  /// Corners of the bounds, metres; bounds_max is not below bounds_min, and a side shorter than 1 m is extended to 1 m.
  /// Objects may be anywhere, see farthest_coordinate: the bounds only say where most of them are. Within the bounds
  /// cost is least. Outside them the broad phase is as fine as 2^-18 of the distance from the bounds plus one side.
  ///
  /// Both 0, the default: the World chooses a cube around the first objects, except for a few that are far from the
  /// others, in the first frame that has objects; config() returns it from then on. Until then, and with remote_nodes,
  /// the bounds are 0 to 100 m on each axis.
  Vec3d bounds_min{0, 0, 0};
  Vec3d bounds_max{0, 0, 0};
  /// Number of CD nodes, 0 to 1024, and at most the number of cells. 0: the thread that calls World steps the server,
  /// one CD node and all user nodes.
  std::uint32_t nodes = 1;
  std::uint32_t user_threads = 1;  ///< threads that run the user nodes, 1 to 256; ignored with nodes = 0
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::automatic;
  /// Metres around its avatars within which a user node reads the states of other objects, >= 0; 0: it reads none.
  double interest = 25;
  Capacities capacities;
  Limits limits;
  Deadlines deadlines;
  Quotas quotas;
  /// Limit of the list of contacts, for crowds: a contact is listed if it is among the `deepest_contacts` deepest ones
  /// of either of its two objects, ties by (a, b). 0: all contacts are listed. It bounds the output, not the tests. An
  /// unlisted contact is no contact of that frame for everyone: World, users, motion models, saves. So it may begin and
  /// end while the two objects keep touching. FrameReport::unlisted counts them.
  std::uint32_t deepest_contacts = 0;
  /// Whether regions follow the load: the map changes at the end of a frame when the nodes' costs are unequal. With
  /// two nodes or more, the first plan of a map starts one more thread, which computes maps and otherwise sleeps.
  bool balance = true;
  BalanceBy balance_by = BalanceBy::cpu_time;
  /// Whether each thread of the World is pinned to a hardware thread. If there are too few, threads share them.
  bool pin = false;
  /// Number of frames before the last one that queries of World::snapshot() can ask about, 0 to 4096. Each takes 72
  /// bytes for each object of the world, and about 100 more once a query has asked about it.
  std::uint32_t history = 0;
  /// Metres around its object, at the pose of the frame before, within which a motion model may ask queries about that
  /// frame, >= 0; 0: it may not, and MotionInput::senses is null. Costs about 3 ms a frame for 64,000 objects, in
  /// begin_frame, whether the model asks or not. See ringfence/senses.hpp.
  double sense = 0;
  bool timeline = false;  ///< whether FrameReport::timeline is filled with what each thread did and when
  Tuning tuning;          ///< settings for measurements
  LayerMatrix layers;
  std::shared_ptr<const MotionModel> motion;  ///< null: objects move only by World::move and World::place
  /// To restore a World whose save has support shapes: their functions, in any order; see SupportFunction::name.
  std::vector<std::shared_ptr<const SupportFunction>> support_functions;
  LogHook log;  ///< null: nothing is logged
  /// Null: frames are not recorded. Otherwise it receives what determines each frame, before the frame begins; see
  /// ringfence/journal.hpp. Costs time that is proportional to the number of requests.
  std::shared_ptr<Recorder> recorder;
  /// Null: CD nodes are threads of this process. Otherwise the constructor of World waits for `nodes` remote nodes.
  /// Nodes that arrive later are added between frames, up to one for each cell and 1024 in all; further nodes wait
  /// until there is room. Nodes that ask to leave are released. If no node is left, the server's thread does their
  /// work. One RemoteNodes object serves one World.
  std::shared_ptr<RemoteNodes> remote_nodes;
};

}  // namespace ringfence
