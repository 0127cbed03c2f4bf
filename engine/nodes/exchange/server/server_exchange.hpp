#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/flat_list.hpp"
#include "messages/header.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// The server's side of the streams between it and the CD nodes, and its control of those between the nodes; see
/// NodeExchange for their side. ServerSetup::exchange chooses the implementation: SharedServerExchange or
/// MessageServerExchange. The parts of the server do not know which one they have.
///
/// Virtual functions are called once per step or node. The defaults do nothing.
///
/// Threads: belongs to the server role; between frames the facade may read hosts.
class ServerExchange {
 public:
  /// What ServerState::setup requests. `state` outlives it.
  static std::unique_ptr<ServerExchange> make(ServerState& state);
  virtual ~ServerExchange() = default;
  ServerExchange(const ServerExchange&) = delete;
  ServerExchange& operator=(const ServerExchange&) = delete;

  /// Whether the memory of the nodes can be read: the objects that they host between frames and while they wait, and
  /// their publications. If not, the table has the states of all objects, and the server publishes them.
  bool reads_nodes() const noexcept { return reads_nodes_; }
  /// Whether nodes are known to follow the protocol. If not, each message is checked, and a node that sends an invalid
  /// one is lost.
  bool trusts_nodes() const noexcept { return reads_nodes_; }
  /// The objects that a connected node hosts. Precondition of all three: reads_nodes().
  static const Host& host_of(const PeerSession& node) noexcept { return *node.connection.node_contacts->host; }
  /// The objects that it knows; between frames.
  static const RegionObjects& known_by(const PeerSession& node) noexcept {
    return *node.connection.node_contacts->objects;
  }
  /// The host-owned states that it keeps for recovery.
  static const HostOwnedStates& kept_states(const PeerSession& node) noexcept {
    return node.connection.node_contacts->host_states;
  }

  // Control of the frame, within a process by FrameControl. Otherwise messages say the same.
  /// Starts a run of `records` records to a CD node. Within a process a run without records is not sent: its end is
  /// announced, and counts like the message that it replaces.
  void start_run(messages::RunSender& run, messages::MessageType type, std::size_t records) const noexcept;
  /// Starts `frame_end` to a CD node, when PeerSession::hand_overs is known. Within a process the node reads it when
  /// the end of the frame is announced, and nothing is sent.
  virtual void start_end(PeerSession& node, bool hosts_exchange_objects) = 0;
  /// Sends the region map to a node, in a run that was started; true when it is sent.
  virtual bool send_map(PeerSession& node, messages::RunSender& run) = 0;
  /// At the cut, when it is known which nodes take part in the frame.
  virtual void expect_nodes() {}
  /// All messages that belong to the step have been sent with ServerState::send_to_nodes(): wakes the nodes that do not
  /// know it yet. `reached`: notes when, for each node, unless they are woken together.
  virtual void announce(AnnouncedStep step, PeerSession::Reached PeerSession::*reached = nullptr) = 0;
  /// The node is lost, or has left before this cut: no later announcement concerns it.
  virtual void dismiss(PeerSession&) noexcept {}
  /// A fallback node is connected: it follows what is announced.
  virtual void admit(PeerSession&) noexcept {}
  /// At the end of a frame.
  virtual void finish() {}
  /// Between frames. Precondition: the threads of all lost nodes have ended.
  virtual void free_abandoned() noexcept {}

  /// At the cut, and before the frame is detected again: nodes have sent each other nothing.
  virtual void begin() {}
  /// A `ghost_counts` or `contact_counts` message: what a node sends to the others directly. Returns false if it is
  /// invalid.
  virtual bool receive_counts(const PeerSession&, const messages::MessageView&) { return false; }

  /// At the cut: the queries that the CD nodes answer in this frame, if any.
  virtual void begin_queries() = 0;
  /// At the cut, if models may ask queries: the frame before, for the CD nodes that host objects.
  virtual void begin_senses() = 0;
  /// Before the node's `frame_begin`: sends the queries to it. Returns true when they are sent, or it reads them.
  virtual bool send_queries(PeerSession&) { return true; }
  /// The same for what its models may sense.
  virtual bool send_sensed(PeerSession&) { return true; }
  /// A `query_hit` message of a node. Returns false if it is invalid.
  virtual bool receive_hits(const PeerSession&, const messages::MessageView&) { return false; }
  /// What a connected node has answered in the last frame. Between frames.
  virtual const NodeQueries& queries_of(const PeerSession& node) const noexcept = 0;

  /// Before the last position of the frame is sent: nodes that have received it exchange ghost updates, or not.
  virtual void begin_ghosts(bool exchanged) noexcept { ghosts_exchanged_ = exchanged; }
  /// Announces to a node how many ghost updates it receives. Returns true when that is sent, or not needed.
  virtual bool send_ghosts(PeerSession&) { return true; }
  /// A node is lost: ghost updates are no longer read in this frame, by no node, because all objects are sent again.
  virtual void close_ghost_gates() noexcept {}
  /// Whether a lost node still reads ghost updates or hand-overs. Then no other node may begin the next frame.
  virtual bool is_reading() const noexcept { return false; }

  /// When all nodes have moved: adds what they have listed in StepReport::next_hosts.
  virtual void list_next_hosts(base::FlatList<NextHostOf>&) {}

  /// After `narrow_done` of a node: all its contacts are in the ledger.
  virtual void receive_contacts(PeerSession& node, Statistics& statistics) = 0;
  /// Contacts that a node found are not in the list of contacts: it will not send them to other nodes. Before the map
  /// of the next frame is known.
  virtual void retract_contacts(const PeerSession&, std::span<const UnlistedContact>) {}
  /// The number of contacts that a node receives as messages of other nodes in this frame.
  virtual std::uint64_t announced_contacts(const PeerSession&) const noexcept { return 0; }
  /// A node is lost after the contacts are known. What it has not sent to the others, these get at the next cut.
  virtual void cancel_contacts(NodeNumber) {}
  /// At the end of the frame: counts what nodes have given each other.
  virtual void count_records(Statistics& statistics) const noexcept = 0;

 protected:
  /// What was exchanged with one node in this frame.
  struct Exchanged {
    std::uint64_t ghosts, contacts;
  };

  ServerExchange(ServerState& state, bool reads_nodes) noexcept : state_(state), reads_nodes_(reads_nodes) {}
  void count(Statistics& statistics, const Exchanged& exchanged) const noexcept;

  ServerState& state_;
  bool ghosts_exchanged_ = false;  ///< in this frame

 private:
  const bool reads_nodes_;
};

}  // namespace ringfence::nodes
