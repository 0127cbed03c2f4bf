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
  user,            ///< all objects are spread over the user nodes
  user_server,     ///< the server hosts active and non-active objects
  user_collision,  ///< the CD node of its region hosts each of them
};
constexpr const char* name_of(Deployment deployment) noexcept {
  constexpr const char* names[] = {"user", "user-server", "user-collision"};
  return names[static_cast<std::size_t>(deployment)];
}

/// Where the broad phase runs. Same candidates, same contacts; the choice is about cost.
enum class Placement : std::uint8_t {
  server,     ///< the server sweeps all objects and sends each node its pairs
  region,     ///< the server assigns objects to regions; each node sweeps its own and keeps the pairs that it owns
  automatic,  ///< the World chooses when it is made: server with one node, else region; World::config() has which
};
constexpr const char* name_of(Placement placement) noexcept {
  constexpr const char* names[] = {"server", "region", "auto"};
  return names[static_cast<std::size_t>(placement)];
}

/// What regions are balanced by. Same contacts; the choice is about cost.
enum class BalanceBy : std::uint8_t {
  cpu_time,  ///< what each node was measured to cost: prices in dear shapes and slow cores
  pairs,     ///< the pairs that each node tested: the same maps in every run, on any machine
};
constexpr const char* name_of(BalanceBy by) noexcept {
  constexpr const char* names[] = {"cpu", "pairs"};
  return names[static_cast<std::size_t>(by)];
}

/// Which layers collide. Without names there is one layer, number 0, and all collide.
struct LayerMatrix {
  std::vector<std::string> names;                              ///< at most 32
  std::vector<std::pair<std::uint8_t, std::uint8_t>> collide;  ///< unordered pairs of layer numbers

  /// The row of `layer` as a bit mask of the layers that it collides with.
  std::uint32_t mask(std::uint8_t layer) const noexcept;
};

enum class LogLevel : std::uint8_t { debug, info, warning, error };
/// Takes one line without newline. Called from the thread that calls World, or from the server thread; never
/// concurrently, never inside a node.
using LogHook = std::function<void(LogLevel, std::string_view)>;

/// Reserved at construction, so that frames allocate nothing. What a frame needs beyond grows at the price of an
/// allocation, loses nothing, and is reported (FrameReport::grown, and once through the log hook).
struct Capacities {
  std::size_t objects = 4096;
  std::size_t pairs = 32768;     ///< candidates a frame, all nodes together
  std::size_t contacts = 16384;  ///< a frame
  std::size_t users = 128;
};

/// How long the server waits for others within a frame, in milliseconds; 0: for ever. Without effect with nodes = 0.
///
/// Choose several times the longest frame: on a machine with more threads than cores a node that lives may be silent
/// for as long as the others take.
struct Deadlines {
  /// A CD node that is silent for so long, though asked, is lost: see FrameReport::lost.
  double node_ms = 0;
  /// A user node has so long to move, and so long to take its contacts. One that does not make it keeps its old poses
  /// in that frame and is disconnected at the next cut: see FrameReport::late.
  double user_ms = 0;
};

/// What one user node may use; 0: as much as it likes. What is beyond is refused with Status::over_quota, and costs the
/// others nothing: however much it sends, the server reads at most 64 KiB of it before it turns to the others.
struct Quotas {
  std::size_t avatars = 0;  ///< alive at the same time; spawn refuses more
  std::size_t updates = 0;  ///< states in its messages of a frame; those beyond are left out
  std::size_t bytes = 0;    ///< of its messages of a frame; messages beyond are left out, but for their saying that the
                            ///< node has told all
};

/// How far it may grow: calls beyond are refused with Status::over_capacity.
struct Limits {
  std::size_t objects = 16'777'216;
  std::size_t users = 65'536;
};

/// CD nodes in other processes, here or on other machines: see ringfence/cluster.hpp of ringfence::dds.
class RemoteNodes;

/// What a World is made of. Checked as a whole by the constructor, which throws Error naming the field.
struct WorldConfig {
  Vec3d bounds_min{0, 0, 0};  ///< metres; objects may leave the bounds: the outer regions reach to infinity
  Vec3d bounds_max{100, 100, 100};
  std::uint32_t nodes = 1;         ///< CD nodes, 0 to 1024; 0: server, one node and the users run in the calling thread
  std::uint32_t user_threads = 1;  ///< threads that carry the user nodes, 1 to 256; ignored with nodes = 0
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  std::uint32_t cells_log2[3] = {0, 0, 0};  ///< cells on each axis as a power of two, 0 to 10 each; all 0: chosen
  double interest = 25;  ///< metres: how far around its avatars a user node reads others' states; >= 0
  Capacities capacities;
  Limits limits;
  Deadlines deadlines;
  Quotas quotas;
  std::size_t ring_bytes = 0;  ///< of every ring; a power of two, 4096 to 2^30; 0: by role
  bool balance = true;  ///< regions follow the load: the map changes at frame ends when nodes cost unequal amounts
  BalanceBy balance_by = BalanceBy::cpu_time;
  bool keep_resting = true;  ///< the broad phase keeps what does not move apart; off: for comparison, the same contacts
  bool pin = false;          ///< pin threads to cores where there are enough of them
  bool timeline = false;     ///< note in FrameReport::timeline what each thread did when
  bool remember_axes = true;  ///< nodes remember what kept hulls apart; for the cost alone, contacts are the same
  LayerMatrix layers;
  std::shared_ptr<const MotionModel> motion;  ///< null: objects move only by World::move and World::place
  LogHook log;                                ///< null: silent
  /// Null: CD nodes are threads of this process. Else the World waits until the fleet has `nodes` of them, takes in
  /// those that come later, up to one a cell and 1024 in all (more wait until there is room), and lets go of those that
  /// ask to leave; where none is left, the server's thread does the work. Serves one World and outlives it.
  std::shared_ptr<RemoteNodes> remote_nodes;
};

}  // namespace ringfence
