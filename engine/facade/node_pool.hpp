#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "facade/remote_nodes.hpp"
#include "facade/threads/worker.hpp"
#include "link/wake_tree.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "nodes/role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/ids.hpp"
#include "telemetry/track.hpp"

namespace ringfence::facade {

/// A duplex channel between two roles, whatever it is made of. The ends are valid as long as it exists.
struct PoolChannel {
  nodes::Connection first;  ///< with the server: the server's end; between nodes: the end of the lower slot
  nodes::Connection second;
  std::shared_ptr<void> owner;  ///< owns what the ends refer to
};

/// A CD node of a World. Destroyed in reverse order: first its thread ends.
struct PoolNode {
  NodeNumber slot = 0;  ///< another node may have it later
  NodeNumber id = 0;    ///< never used again
  RemoteNodes::MemberId member = RemoteNodes::local_member;
  PoolChannel server;
  std::unique_ptr<telemetry::Track> track;  ///< null without WorldConfig::timeline, and for a node of another process
  std::unique_ptr<nodes::CdNodeRole> role;  ///< null for a node of another process
  std::unique_ptr<Worker> worker;           ///< null if the server's thread steps the role, or another process
  bool is_stepped = false;                  ///< a thread steps the role, or may do so
  bool outlived_frame = false;              ///< a frame was complete since it is gone
};

/// What a pool needs to make nodes.
struct NodePoolSetup {
  /// What the setups of all roles have in common. The pool sets the rest: `node`, `objects`, `pairs`, `track`,
  /// `shares_thread`, `faults`, `server`.
  nodes::CdNodeSetup role;
  std::size_t objects = 0;  ///< of the world; each node reserves for twice its even share
  std::size_t pairs = 0;
  nodes::FaultRelease* faults = nullptr;  ///< for nodes with a thread of their own
  bool timeline = false;
  /// Makes the channel between the server and a node whose other members are set, except the role, with what the node
  /// shares. `nodes` is the number of nodes.
  std::function<PoolChannel(const PoolNode& node, std::size_t nodes)> connect_to_server;
  /// Makes the channel between two nodes; the first has the lower slot. Unused if the nodes share memory.
  std::function<PoolChannel(const PoolNode& first, const PoolNode& second, std::size_t nodes)> connect;
  /// Starts a thread; false if the system has none.
  std::function<bool(Worker&)> start_worker;
};

/// The CD nodes of a World: their slots, ids, channels, threads and roles, and those of nodes that are gone until
/// nothing refers to them.
///
/// A node keeps its slot and its id from add() to remove(). The lowest free slot is taken first. Ids count up from 0
/// and are never used again.
///
/// A node that is gone, because it was lost or has left, is *retired*. The thread of a lost node may still run: then it
/// reads and writes the node's own memory, its channels, and the memory of any node that it was connected with. So
/// nothing of any retired node is freed before the threads of all of them have ended. Besides, users read the
/// publication of a retired node until the next frame is complete; so it also outlives that frame.
///
/// Threads: the one that calls World, while no frame is running; replace() also while the server waits for it. Memory
/// is allocated only when nodes join or leave.
class NodePool {
 public:
  explicit NodePool(NodePoolSetup setup);

  /// What one of `nodes` nodes reserves of a capacity of the world: twice its even share.
  static std::size_t share_of(std::size_t capacity, std::size_t nodes) noexcept {
    return std::min(capacity, 2 * capacity / nodes + 64);
  }

  /// Number of nodes.
  std::size_t size() const noexcept;
  /// All slots in use are below this number.
  NodeNumber slots() const noexcept { return static_cast<NodeNumber>(nodes_.size()); }
  /// The node in a slot, or null.
  PoolNode* at(NodeNumber slot) const noexcept { return slot < nodes_.size() ? nodes_[slot].get() : nullptr; }
  /// The node with that id, or null.
  PoolNode* find(NodeNumber id) const noexcept;
  /// Calls visit(node) for all nodes, by ascending slot.
  template <class Visit>
  void each(Visit visit) const {
    for (const auto& node : nodes_) {
      if (node != nullptr) {
        visit(*node);
      }
    }
  }
  /// What each node shares, by slot; null where there is no node.
  std::shared_ptr<const nodes::SharedNodes> shared_nodes() const;
  /// Slots of the `count` nodes that joined last.
  std::vector<NodeNumber> youngest(std::size_t count) const;
  /// The connections of a node to the others, by their slots; empty where there is none. Nodes that share memory have
  /// none: they read what the others list in place.
  std::vector<nodes::Connection> peers_of(const PoolNode& node) const;
  /// Nodes that are gone and not freed yet.
  std::span<const std::unique_ptr<PoolNode>> retired() const noexcept { return retired_; }

  /// Creates the threads that are missing if there shall be `count` nodes, all with threads of their own; ends those
  /// that are too many. If one cannot be created, ends all and returns false.
  bool prepare_threads(std::size_t count);
  /// Adds a node. It is not connected with the others until connect(). `total` is the number of nodes when all have
  /// joined. With `own_thread` it gets a thread that prepare_threads() has created. For a member of another process
  /// only the channels are made.
  PoolNode& add(const regions::RegionMap& map, std::size_t total, bool own_thread,
                RemoteNodes::MemberId member = RemoteNodes::local_member);
  /// Within a frame: all nodes are lost. Retires the one in this slot and puts a node without a thread in its place,
  /// connected with none.
  PoolNode& replace(NodeNumber slot, const regions::RegionMap& map);
  /// Retires the nodes in these slots. Their threads are asked to end. Call connect() afterwards. Precondition: the
  /// server's thread steps none of them.
  void remove(std::span<const NodeNumber> slots);
  /// Gives the roles of this process their connections with the others and has their threads step them. Returns what
  /// wakes all these threads; null if there are few of them, or not every node has one.
  std::shared_ptr<link::WakeTree> connect();
  /// At the end of each frame: frees what can be freed. Returns whether the threads of all retired nodes have ended.
  bool free_retired();

  /// Calls visit(worker) for all threads, also prepared and retired ones.
  template <class Visit>
  void each_worker(Visit visit) const {
    for (const auto* list : {&nodes_, &retired_}) {
      for (const auto& node : *list) {
        if (node != nullptr && node->worker != nullptr) {
          visit(*node->worker);
        }
      }
    }
    for (const auto& worker : prepared_) {
      visit(*worker);
    }
  }

 private:
  using Ends = std::pair<NodeNumber, NodeNumber>;  ///< slots, the lower one first

  /// With so many threads or fewer, the server wakes each: the first nodes then start sooner.
  static constexpr std::size_t max_woken_directly = 16;

  std::shared_ptr<link::WakeTree> make_wake_tree() const;
  bool shares() const noexcept { return setup_.role.exchange == nodes::ExchangeKind::shared; }
  std::unique_ptr<PoolNode> make_node(NodeNumber slot, std::size_t total, std::unique_ptr<Worker> worker,
                                      RemoteNodes::MemberId member);
  void make_role(PoolNode& node, std::size_t total, const regions::RegionMap& map);
  void retire(NodeNumber slot);

  NodePoolSetup setup_;
  std::vector<std::unique_ptr<PoolNode>> nodes_;  ///< by slot; null: the slot is free
  NodeNumber next_id_ = 0;
  std::vector<std::unique_ptr<Worker>> prepared_;  ///< threads of nodes that join later
  std::map<Ends, PoolChannel> channels_;           ///< between nodes that share no memory
  std::vector<std::unique_ptr<PoolNode>> retired_;
  std::vector<PoolChannel> retired_channels_;  ///< between retired nodes and other nodes
};

}  // namespace ringfence::facade
