#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/shape.hpp"

/// CD nodes as separate processes, on this machine or on others. The processes exchange the messages of
/// docs/protocol.md over TCP, and find each other by Eclipse Cyclone DDS. Needs the library ringfence::dds. For a
/// trusted network only: there is no encryption and no authentication.
namespace ringfence::dds {

/// How processes discover each other, and how long one may be silent. Used by a World and by its nodes; both need the
/// same domain and lease.
struct NetworkConfig {
  static constexpr std::uint32_t any_domain = 0xffffffffu;

  /// DDS domain: 0 to 200. For a World also any_domain: the first domain whose port is free on this machine.
  std::uint32_t domain = 0;
  /// Name of the World; Worlds with different names can share a domain, and a node serves only Worlds with its name. Up
  /// to 64 letters, digits, '.', '-' and '_'; the empty name is also a name. On one machine, a domain holds one World
  /// with the empty name and up to seven others.
  std::string world;
  /// Name or address of the network interface; "lo" restricts the World to processes of this machine. Empty: Cyclone
  /// DDS chooses.
  std::string interface;
  /// For nodes: addresses of the World's machine. Empty: discovery by multicast; with "lo", on this machine.
  std::vector<std::string> peers;
  /// A process that is silent for this long is lost, milliseconds. 10 to 60,000.
  double lease_ms = 100;
  /// Requested socket buffer size, bytes. If the system grants less (net.core.rmem_max), a warning is logged.
  std::size_t socket_bytes = std::size_t{4} << 20;
};

/// Traffic between the World and one node process, counted by the World.
struct MemberReport {
  std::string name;  ///< host:process, or NodeServiceConfig::name
  NodeId node;       ///< its id as a CD node
  std::uint64_t sent_parcels = 0, sent_bytes = 0;
  std::uint64_t received_parcels = 0, received_bytes = 0;
  std::uint64_t shared_bytes = 0;         ///< of sent_bytes: through memory that both processes share; 0 over a network
  std::uint64_t retransmitted_bytes = 0;  ///< by TCP, to this node
  std::uint64_t refused_writes = 0;       ///< how often the link did not take all that was to be sent
  std::uint64_t answers = 0;              ///< replies received while one was awaited
  double answer_ms_mean = 0;              ///< from the first parcel without a reply to the next reply
  double answer_ms_max = 0;
};

/// A node joined, left or was lost; with the durations that the World measured.
struct MemberChange {
  enum class Kind : std::uint8_t {
    joined,  ///< `before_ms`: from its first announcement to its assignment; `after_ms`: from then to its first message
    left,    ///< `before_ms`: from its request to leave until it had handed everything over; `after_ms`: 0
    lost,    ///< `before_ms`: silence before the loss was detected; `after_ms`: from then to the end of the frame
  };
  Kind kind = Kind::joined;
  std::string name;
  double at = 0;  ///< time of the assignment, departure or detected loss: seconds since 1970
  double before_ms = 0;
  double after_ms = 0;
};

/// "joined", "left", "lost".
constexpr const char* name_of(MemberChange::Kind kind) noexcept {
  constexpr const char* names[] = {"joined", "left", "lost"};
  return names[static_cast<std::size_t>(kind)];
}

/// Membership and traffic of the whole cluster.
struct ClusterReport {
  static constexpr std::size_t max_changes = 256;

  std::vector<MemberReport> members;  ///< nodes that are part of the World, in the order of FrameReport::nodes
  std::vector<MemberChange> changes;  ///< the last `max_changes`, oldest first
  std::uint64_t joined = 0, left = 0, lost = 0, refused = 0;
  std::uint64_t stale_parcels = 0;  ///< refused: sent before a loss was known, or by a process that is not assigned
};

/// The World's side: discovers nodes and carries the messages between the server and the nodes.
struct ClusterConfig {
  NetworkConfig network;
  double wait_ms = 10'000;       ///< how long the World's constructor waits for its first nodes
  std::vector<std::byte> setup;  ///< the embedder's own bytes, passed to each node's ModelMaker
  LogHook log;  ///< nodes that join, leave, are lost or are refused; called from the thread that calls World
};

class ClusterNodes;

/// Joins a DDS domain in its constructor, so that nodes can be started before the World. Throws Error if that fails.
///
///   ringfence::dds::Cluster cluster({.network = {.interface = "eth0"}});
///   config.nodes = 4;  // the World's constructor waits for four nodes
///   config.remote_nodes = cluster.remote_nodes();
///   ringfence::World world(config);
///
/// Threads: as World. Serves one World; may be destroyed before it.
class Cluster {
 public:
  explicit Cluster(ClusterConfig config);
  ~Cluster();
  Cluster(const Cluster&) = delete;
  Cluster& operator=(const Cluster&) = delete;

  std::shared_ptr<RemoteNodes> remote_nodes() const;
  /// The domain number; with any_domain the one that was chosen.
  std::uint32_t domain() const noexcept;
  /// Call it between frames.
  ClusterReport report() const;

 private:
  std::shared_ptr<ClusterNodes> nodes_;
};

/// Makes a node's motion model from ClusterConfig::setup; null if objects move only by calls. Throws Error on failure.
/// The model must compute the same states as the World's own.
using ModelMaker = std::function<std::shared_ptr<const MotionModel>(std::span<const std::byte> setup)>;
/// Returns the support function that the World registered under that shape number.
using SupportMaker = std::function<std::shared_ptr<const SupportFunction>(ShapeId)>;

/// Configuration of a node process.
struct NodeServiceConfig {
  NetworkConfig network;
  std::string name;      ///< for logs and reports; empty: host:process
  ModelMaker model;      ///< null: objects move only by calls
  SupportMaker support;  ///< null: the node refuses a World that has support functions
  bool once = false;     ///< run() returns when the first World ends, instead of waiting for the next
  LogHook log;
};

/// Why NodeService::run returned.
enum class ExitReason : std::uint8_t {
  drained,    ///< drain() was called, and everything was handed over
  dismissed,  ///< the World ended or released the node (only with NodeServiceConfig::once)
  abandoned,  ///< the World disappeared without releasing the node (only with NodeServiceConfig::once)
  refused,    ///< node and World are incompatible, or the World sent invalid data (only with NodeServiceConfig::once)
};
/// "drained", "dismissed", "abandoned", "refused".
constexpr const char* name_of(ExitReason reason) noexcept {
  constexpr const char* names[] = {"drained", "dismissed", "abandoned", "refused"};
  return names[static_cast<std::size_t>(reason)];
}

/// What a node process has done; totals are of all Worlds that it has served.
struct NodeServiceReport {
  bool serves = false;            ///< it is assigned in a World
  std::uint64_t frames = 0;       ///< complete frames
  std::uint64_t objects = 0;      ///< objects that it hosts; 0 if the deployment lets the server host them
  std::uint64_t handed_over = 0;  ///< objects that it has handed over to other nodes
  double frame_busy_s = 0;        ///< work in the last frame
  double cpu_s = 0;               ///< CPU time of its frames
};

/// A CD node process: joins a domain, waits for a World and serves its frames.
///
/// Threads: run() occupies its thread until it returns; drain() may be called from any other thread and from a signal
/// handler, report() from any thread. run() computes in the default floating-point environment and restores the
/// modes of the caller on return.
class NodeService {
 public:
  /// Joins the domain. Throws Error if that fails.
  explicit NodeService(NodeServiceConfig config);
  ~NodeService();
  NodeService(const NodeService&) = delete;
  NodeService& operator=(const NodeService&) = delete;

  ExitReason run();
  /// Requests that the node leaves: in the next frame it hands everything over, then run() returns. Without a World,
  /// run() returns at once. A second call makes run() return without handing over; the World then detects a loss.
  /// Async-signal-safe.
  void drain() noexcept;
  NodeServiceReport report() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::dds
