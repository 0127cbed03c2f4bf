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

/// CD nodes as processes, on this machine or on others: the messages of docs/protocol.md, carried by Eclipse Cyclone
/// DDS. Needs the library ringfence::dds. For a trusted network: nothing is encrypted, and nobody is asked for a
/// password.
namespace ringfence::dds {

/// How processes find each other, and how long one may be silent. The same for a World and its nodes.
struct NetworkConfig {
  static constexpr std::uint32_t any_domain = 0xffffffffu;

  /// One World a domain: 0 to 200, or any_domain for a World: the first whose port is free on this machine.
  std::uint32_t domain = 0;
  /// Name or address of the network interface, "lo" for processes of this machine alone; empty: Cyclone DDS chooses.
  std::string interface;
  /// For nodes: where the World is, as addresses. Empty: found by multicast; with "lo", on this machine.
  std::vector<std::string> peers;
  /// Who is silent for so long is lost. 10 to 60,000.
  double lease_ms = 100;
  /// What sockets are asked to hold, bytes. The system may grant less (net.core.rmem_max); then it is logged.
  std::size_t socket_bytes = std::size_t{4} << 20;
};

/// What one node's process did, as the World's end of its way sees it.
struct MemberReport {
  std::string name;       ///< host:process, or as given
  NodeNumber number = 0;  ///< its place from the last frame on
  std::uint64_t sent_parcels = 0, sent_bytes = 0;
  std::uint64_t received_parcels = 0, received_bytes = 0;
  std::uint64_t retransmitted_bytes = 0;  ///< by Cyclone DDS, to it
  std::uint64_t refused_writes = 0;       ///< times that its way was full
  std::uint64_t answers = 0;              ///< times that it was awaited and spoke
  double answer_ms_mean = 0;              ///< from the first parcel that it had not answered to its next
  double answer_ms_max = 0;
};

/// Somebody has come or gone, and how long that took, as the World saw it.
struct MemberChange {
  enum class Kind : std::uint8_t {
    joined,  ///< `before_ms`: from its first word until it had a seat; `after_ms`: from then until it spoke in a frame
    left,    ///< `before_ms`: from its asking to leave until it had handed everything over; `after_ms`: 0
    lost,    ///< `before_ms`: how long it had been silent when that was noticed; `after_ms`: from then to frame's end
  };
  Kind kind = Kind::joined;
  std::string name;
  double at = 0;  ///< when it had its seat, had left, or was found to be lost: seconds since 1970
  double before_ms = 0;
  double after_ms = 0;
};

/// What the whole cluster did.
struct ClusterReport {
  static constexpr std::size_t most_changes = 256;

  std::vector<MemberReport> members;  ///< with a seat, by number
  std::vector<MemberChange> changes;  ///< the last `most_changes`, oldest first
  std::uint64_t joined = 0, left = 0, lost = 0, refused = 0;
  std::uint64_t stale_parcels = 0;  ///< came from before a loss and were refused
};

/// The World's side: finds nodes, and carries what server and nodes say to each other.
struct ClusterConfig {
  NetworkConfig network;
  double wait_ms = 10'000;       ///< how long a World waits for its first nodes
  std::vector<std::byte> setup;  ///< the embedder's own, given to each node's ModelMaker
  LogHook log;                   ///< who joins, leaves, is lost or refused; from the thread that calls World
};

class ClusterNodes;

/// Joins a domain at once, so that nodes can be started; throws Error where that cannot be.
///
///   ringfence::dds::Cluster cluster({.network = {.interface = "eth0"}});
///   config.nodes = 4;  // waits for four
///   config.fleet = cluster.fleet();
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
  /// The domain, where any was asked for.
  std::uint32_t domain() const noexcept;
  /// Between frames.
  ClusterReport report() const;

 private:
  std::shared_ptr<ClusterNodes> nodes_;
};

/// Makes the motion model of a World from what its ClusterConfig::setup says; null where objects move by calls alone.
/// Throws Error where it cannot. Must move objects as the World's own model does.
using ModelMaker = std::function<std::shared_ptr<const MotionModel>(std::span<const std::byte> setup)>;
/// The support function that the World registered under that number.
using SupportMaker = std::function<std::shared_ptr<const SupportFunction>(ShapeNumber)>;

/// A node's side.
struct NodeServiceConfig {
  NetworkConfig network;
  std::string name;      ///< for logs and reports; empty: host:process
  ModelMaker model;      ///< null: objects move by calls alone
  SupportMaker support;  ///< null: a World with support functions is refused
  bool once = false;     ///< ends with the first World, instead of waiting for the next
  LogHook log;
};

/// Why a node's service has ended.
enum class ExitReason : std::uint8_t {
  drained,    ///< asked to; everything was handed over
  dismissed,  ///< the World has ended, or has let it go (with NodeServiceConfig::once)
  abandoned,  ///< the World has gone without a word (with NodeServiceConfig::once)
  refused,    ///< it does not fit the World, or the World does not fit it (with NodeServiceConfig::once)
};

/// A CD node as a process of its own: joins a domain, waits for a World, serves its frames.
///
/// Threads: run() is the node's thread; drain() is for any other, and for signal handlers.
class NodeService {
 public:
  /// Joins the domain. Throws Error where that cannot be.
  explicit NodeService(NodeServiceConfig config);
  ~NodeService();
  NodeService(const NodeService&) = delete;
  NodeService& operator=(const NodeService&) = delete;

  ExitReason run();
  /// Asks to leave: in the next frame everything is handed over, and run() returns. Without a World it returns at once;
  /// asked twice, also without handing over: the World then finds it lost. Async-signal-safe.
  void drain() noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::dds
