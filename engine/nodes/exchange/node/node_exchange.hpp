#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/flat_list.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/halo_exchange.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/exchange/peer_lists.hpp"

namespace ringfence::nodes {

class Migration;

/// The streams between a CD node and the others: states for the server, ghost updates and contacts between the nodes,
/// contacts for the output lists. CdNodeSetup::exchange chooses the implementation: SharedExchange or MessageExchange.
/// The parts of a node do not know which one they have.
///
/// Virtual functions are called once per stage, batch of objects or message. A function that returns bool returns
/// false if a ring is full or something has not arrived; then it is called again later. The defaults do nothing: what
/// others can read in place needs no message, and then no message of that kind arrives.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class NodeExchange {
 public:
  /// What NodeState::setup requests. `state` outlives it.
  static std::unique_ptr<NodeExchange> make(NodeState& state);
  virtual ~NodeExchange() = default;
  NodeExchange(const NodeExchange&) = delete;
  NodeExchange& operator=(const NodeExchange&) = delete;

  /// After NodeState::assign().
  virtual void assign() {}
  /// Whether the senders of messages are known to follow the protocol; if not, each message is checked.
  virtual bool trusts_senders() const noexcept = 0;
  /// Publishes partial messages, so that another message can be sent to the server.
  virtual void flush();
  /// After each step of the role: the server shall read the messages that were published in it.
  virtual void finish_step() {}

  // Control of the frame, within a process by FrameControl. Otherwise messages say the same.
  /// What the server has announced last. Call it before the messages of the server are read.
  virtual FrameControl::Announced announced() const noexcept { return {}; }
  /// The frame of the last announcement.
  virtual std::uint64_t announced_frame() const noexcept { return 0; }

  // Queries, to and from NodeContacts::queries.
  /// A `query` message of the server, before the frame to which the queries belong.
  virtual void receive_queries(const messages::MessageView&) {}
  /// A `sensed` message of the server, before the frame whose models may ask about these objects. When a frame has
  /// begun, NodeContacts::sensed refers to all of them.
  virtual void receive_sensed(const messages::MessageView&) {}
  /// Whether the next `sensed` message may have so many objects.
  virtual bool takes_sensed(std::size_t) const noexcept { return false; }
  /// Whether a frame may begin: no query and no sensed object is missing.
  virtual bool may_begin() const noexcept { return true; }
  /// When the queries of the frame are answered: sends the server the answers if it cannot read them.
  virtual bool send_hits() { return true; }

  // States: what the node has moved.
  /// Starts a frame.
  virtual void begin();
  /// The state of hosted object `hosted`, an index in Host, goes to the server. `flags`: messages::ObjectFlag bits.
  void add_change(std::uint32_t hosted, std::uint32_t flags, const geometry::Bounds& bounds) {
    changes_.push_back({hosted, flags, bounds});
  }
  /// The state is host-owned before and after the move: the server needs it only if it cannot read it in place.
  void add_owned(std::uint32_t hosted) { owned_.push_back(hosted); }
  /// If NodeState::lists_next_hosts(): the server has to know the next host of the object in this slot of its table,
  /// and that its state is host-owned.
  void add_next_host(std::uint32_t slot, NodeNumber next) { next_hosts_.push_back({slot, next}); }
  /// After each batch of add_change() and add_owned(), while the objects are in the cache.
  virtual bool report_batch() = 0;
  /// After the last batch, when GhostUpdates has all updates: ends the report.
  virtual bool finish_report() = 0;
  /// The publication of what the node hosts can be read. Only where users read it in place.
  virtual void report_published() noexcept {}

  // Ghost updates, from NodeContacts::ghost_updates to the HaloExchange of the other nodes.
  virtual bool send_ghosts() { return true; }
  /// When all positions of the server have arrived: applies those of the other nodes. In a frame in which the server
  /// sends everything there are none.
  virtual bool receive_ghosts(HaloExchange& halo) = 0;
  /// The number of updates that arrive as messages in this frame, from `ghosts_sent`.
  void expect_ghosts(std::uint64_t updates) noexcept { ghosts_expected_ = updates; }
  /// Updates have arrived in a `ghost` message.
  void count_ghosts(std::uint64_t updates) noexcept { ghosts_arrived_ += updates; }
  /// Whether updates are still to arrive as messages.
  bool expects_ghosts() const noexcept { return ghosts_expected_ != unknown && ghosts_arrived_ < ghosts_expected_; }
  /// All positions of the frame arrive again, from the server: forgets the updates to be sent and received.
  virtual void discard_ghosts() noexcept { ghosts_expected_ = unknown, ghosts_arrived_ = 0; }

  // Contacts, from NodeContacts.
  /// The contacts of the frame are listed. What arrived in this frame before is void, because it is detected again.
  virtual void begin_contacts() {}
  /// Before the next call: the tests of the frame by kinds of shapes. `kinds` stays valid until the next frame begins.
  virtual void list_kinds(std::span<const messages::KindRecord> kinds) noexcept = 0;
  /// Sends to the server what it cannot read, and reports that all pairs are tested.
  virtual bool send_contacts(const messages::NarrowDoneRecord& totals) = 0;
  /// After `frame_end`, when the list of contacts and the phases are final: contacts of objects that other nodes host
  /// go to these, those of hosted objects come from them, and those for the output lists go there.
  virtual void share_contacts() = 0;
  /// Sends the other nodes what they cannot read.
  virtual bool send_to_peers() { return true; }
  /// The number of contacts that other nodes send in this frame, from `frame_end`.
  virtual void expect_contacts(std::uint64_t) noexcept {}
  /// A `notify` message of another node.
  virtual void receive_contacts(const messages::MessageView&) {}

  // Hand-overs, from Host to that of the next hosts. `leaving` has the numbers of the objects by next host, none of
  // which is lost; it does not change until all are sent.
  /// When the contacts of the frame are listed, and after `frame_end` if a new map came with it: lists what others can
  /// read in place.
  virtual void list_hand_overs(const PeerLists&) {}
  /// Whether list_hand_overs() does anything.
  virtual bool lists_hand_overs() const noexcept { return false; }
  /// After `frame_end`, when the objects leave: Host drops each when it is sent, or read in place by its next host.
  virtual void start_hand_overs(const PeerLists& leaving) = 0;
  /// Sends the next hosts what they cannot read.
  virtual bool send_hand_overs() { return true; }
  /// Takes over the objects that others have listed for this node so far, until `migration` has all of them.
  virtual void receive_hand_overs(Migration&) {}

  /// A peer is lost. If contacts were final, those that it has not sent arrive from the server at the next cut.
  virtual void lose(const messages::LostRecord&) noexcept {}
  /// When all contacts of other nodes have arrived: adds them to Host.
  virtual bool complete_contacts() { return true; }

  /// The node has completed the frame: reports its statistics, and its tests by kinds of shapes unless the server has
  /// read them. If it returns false, it takes the values of the next call.
  virtual bool report_done(const messages::NodeFrameStats& stats) = 0;

 protected:
  /// A state for the server.
  struct Change {
    std::uint32_t hosted;
    std::uint32_t flags;
    geometry::Bounds bounds;
  };
  static constexpr std::uint64_t unknown = ~std::uint64_t{0};

  explicit NodeExchange(NodeState& state) : state_(state) {}
  /// Sends changes_ as `node_state` records and clears the list.
  bool send_changes();
  /// Ends the run of `node_state`.
  bool finish_changes();

  NodeState& state_;
  base::FlatList<std::uint32_t> owned_;  ///< indices in Host
  base::FlatList<NextHostOf> next_hosts_;
  base::FlatList<Change> changes_;
  std::uint64_t ghosts_expected_ = unknown;
  std::uint64_t ghosts_arrived_ = 0;

 private:
  std::size_t record_bytes() const noexcept { return sizeof(messages::NodeStateRecord) + state_.host.state_bytes(); }

  std::size_t next_change_ = 0;  ///< next to send
  messages::RunWriter states_run_;
};

}  // namespace ringfence::nodes
