#pragma once

#include <cstdint>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/hand_over_list.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "nodes/exchange/peer_lists.hpp"

namespace ringfence::nodes {

/// Hands hosted objects that have left a CD node's region over to their next hosts, and receives those that enter it.
///
/// The next hosts follow from the poses and the region map, so the server expects the same hand-overs. A lost peer
/// takes part no more: the server takes over the hand-overs in both directions. NodeExchange carries the objects.
///
/// Threads: belongs to the CD node. Memory: grows to the largest number of leaving objects.
class Migration {
 public:
  /// Both outlive this object.
  Migration(NodeState& state, NodeExchange& exchange);

  /// After NodeState::assign().
  void assign() { lost_.assign(state_.setup.slots(), 0); }
  /// Starts a frame: nothing leaves, no peer is lost.
  void begin() noexcept;
  /// Notes that a hosted object stands in another node's cell, by the map valid when it moved.
  void add(ObjectNumber number, NodeNumber next) { leaving_.push_back({number, next}); }
  /// When the contacts of the frame are listed: lists the objects to hand over where the next hosts can read them.
  void list();
  /// After `frame_end`, when map and contacts are final: the objects leave.
  void start();
  /// Sends what the next hosts cannot read. Returns whether all is sent; if not, call it again.
  bool send() { return exchange_.send_hand_overs(); }

  /// Takes over the objects of a `hand_over` message, unless its sender is lost.
  void receive(const messages::MessageView& message);
  /// Takes over the objects that a node, which is not lost, has listed for this one; once, if called again.
  void receive(NodeNumber sender, const HandOverList& list);
  /// Takes over the objects that other nodes have listed so far.
  void receive_listed() { exchange_.receive_hand_overs(*this); }
  /// The number of objects that this node receives in this frame, from `frame_end`. lose() may come before it.
  void expect(std::uint64_t objects) noexcept { expected_ += objects; }
  bool is_complete() const noexcept { return received_ >= expected_; }

  /// A peer is lost. If the record does not request to detect the frame again, its hand-overs are cancelled.
  void lose(const messages::LostRecord& record);
  /// Whether the peer was lost in this frame.
  bool is_lost(NodeNumber peer) const noexcept { return peer < lost_.size() && lost_[peer] != 0; }

 private:
  struct Leaving {
    ObjectNumber number;
    NodeNumber next;  ///< next host
  };

  void list_by_host();
  void count(NodeNumber sender, std::size_t objects);

  NodeState& state_;
  NodeExchange& exchange_;
  std::vector<Leaving> leaving_;
  PeerLists by_host_;                                    ///< numbers of the objects to hand over
  bool listed_ = false;                                  ///< by_host_ is made for this frame
  std::vector<std::uint8_t> lost_;                       ///< by slot: in this frame
  base::FlatList<messages::CountRecord> received_from_;  ///< objects handed over by each node in this frame
  std::uint64_t expected_ = 0;
  std::uint64_t received_ = 0;
};

}  // namespace ringfence::nodes
