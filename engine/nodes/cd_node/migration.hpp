#pragma once

#include <cstdint>
#include <vector>

#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

/// Hands hosted objects that have left a CD node's region over to their next hosts, and receives those that enter it.
///
/// The next hosts follow from the poses and the region map, so the server expects the same hand-overs. A lost peer
/// takes part no more: the server takes over the hand-overs in both directions.
///
/// Threads: belongs to the CD node. Memory: grows to the largest number of leaving objects.
class Migration {
 public:
  explicit Migration(NodeState& state);

  /// After NodeState::setup has new peers.
  void assign();
  /// Starts a frame: nothing leaves, no peer is lost.
  void begin() noexcept;
  /// Notes that a hosted object stands in another node's cell, by the map valid when it moved.
  void add(ObjectNumber number, NodeNumber next) { leaving_.push_back({number, next}); }
  /// When the contacts of the frame are final: lists by next host the objects to hand over.
  void list();
  /// Hands the listed objects over and drops them from Host. Returns whether all are sent; if not, call it again.
  bool send();

  /// Takes over the objects of a `hand_over` message, unless its sender is lost.
  void receive(const messages::MessageView& message);
  /// The number of objects that this node receives in this frame, from `frame_end`.
  void expect(std::uint64_t objects) noexcept { expected_ = objects; }
  bool is_complete() const noexcept { return received_ >= expected_; }

  /// A peer is lost. If the record does not request to detect the frame again, its hand-overs are cancelled.
  void lose(const messages::LostRecord& record);
  /// Whether the peer was lost in this frame.
  bool is_lost(NodeNumber peer) const noexcept { return peer < peers_.size() && peers_[peer].lost; }

 private:
  struct Leaving {
    ObjectNumber number;
    NodeNumber next;  ///< next host
  };
  struct Peer {
    bool lost = false;                  ///< in this frame
    std::uint64_t received = 0;         ///< objects handed over by it in this frame
    std::vector<ObjectNumber> leaving;  ///< objects to hand over to it
    messages::RunSender run;
  };

  void drop(Peer& peer);

  NodeState& state_;
  std::vector<Leaving> leaving_;
  std::vector<Peer> peers_;  ///< by slot
  std::uint64_t expected_ = 0;
  std::uint64_t received_ = 0;
};

}  // namespace ringfence::nodes
