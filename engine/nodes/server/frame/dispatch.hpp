#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"
#include "regions/recent_owners.hpp"

namespace ringfence::nodes {

/// M2: decides which CD nodes receive which objects and, with the broad phase on the server, which node owns which
/// candidate pair; sends both.
///
/// A node receives an object that moves within, into or out of its region, except the objects that it hosts and
/// reported itself. Threads: belongs to the server role. Memory: grows to the largest frame.
class Dispatch {
 public:
  explicit Dispatch(ServerState& state);

  /// Follows the number of node slots. Between frames.
  void resize();

  /// When all user nodes have reported and nodes still move: does what start() can do before they have moved, for
  /// objects that no node hosts. These do not change until all is sent, and no node is lost before start().
  void prepare();
  bool is_prepared() const noexcept { return is_prepared_; }
  /// Lists the updates of each node. The active nodes stay active until the last send_pairs(), or start() is called
  /// again. Objects and map must not change until all is sent.
  void start(UpdateScope scope, const ServerExchange& exchange);
  /// Whether send_updates() has something to send: an update, or to a node of another process that none follows.
  bool has_updates(const PeerSession& node) const noexcept { return !nodes_[node.self.number()].update_run.done(); }
  /// Sends a node its updates; true when all are sent.
  bool send_updates(const PeerSession& node) { return pump_updates(node.self.number()); }
  /// With Placement::server, after all updates: sweeps all objects and sends each candidate to its owner as it is
  /// found. A full ring interrupts the sweep: then it returns false, and is called again.
  bool send_pairs();
  /// Sends the unfinished message of pairs for `node`, so that another message may follow.
  void flush(NodeNumber node);

  /// Number of candidates sent. Only with Placement::server.
  std::size_t candidates() const noexcept { return candidates_; }
  /// Time spent on the sweep and its messages since start().
  std::uint64_t sweep_ns() const noexcept { return sweep_ns_; }

 private:
  static constexpr std::uint32_t gone = 0x80000000u;
  /// Bytes: 2000 pairs keep a node busy while the next message is filled.
  static constexpr std::size_t pair_message = std::size_t{1} << 14;
  /// Number of records that are prepared. A record is much larger than a slot, and a frame in which many objects are
  /// spawned has many.
  static constexpr std::size_t max_prepared = 4096;

  /// What is sent to one node.
  struct Node {
    link::Sender* link = nullptr;        ///< null: no active node in the slot
    std::vector<std::uint32_t> updates;  ///< slots, with the bit `gone`
    std::size_t first_prepared = 0;      ///< in prepared_
    std::size_t prepared = 0;            ///< number of the first updates whose records are there
    messages::RunSender update_run;
    messages::RunWriter pair_run{pair_message};
  };

  void begin();
  /// Calls visit(slot) for ObjectTable::unnotified() from seen_ on.
  template <class Visit>
  void each_unnotified(Visit visit) const;
  void list_updates(UpdateScope scope);
  void list_update(std::uint32_t slot, bool all_objects);
  messages::PositionRecord position_of(std::uint32_t update) const noexcept;
  bool pump_updates(NodeNumber to);
  bool pump_pairs();
  messages::RunHeader pairs_to(NodeNumber node) const noexcept {
    return state_.head(messages::MessageType::pairs, messages::Endpoint::node(node));
  }

  ServerState& state_;
  broad_phase::SweepAndPrune sweep_;
  std::vector<Node> nodes_;  ///< by slot
  bool is_prepared_ = false;
  std::vector<messages::PositionRecord> prepared_;  ///< node after node
  std::size_t seen_ = 0;                            ///< number of unnotified objects that prepare() has seen
  std::vector<std::uint32_t> hosted_by_nodes_;      ///< slots of those that it has left
  bool sweeping_ = false;
  std::span<const geometry::CandidatePair> found_;  ///< not sent yet
  std::uint64_t sweep_ns_ = 0;
  std::vector<std::uint64_t> stamps_;
  std::uint64_t stamp_ = 0;
  messages::Endpoint last_host_ = messages::Endpoint::none();  ///< of the last listed update
  regions::RecentOwners avatar_owners_;
  std::size_t candidates_ = 0;
};

}  // namespace ringfence::nodes
