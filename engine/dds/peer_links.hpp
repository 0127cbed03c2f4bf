#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "base/numbers.hpp"
#include "dds/link_socket.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/wire.hpp"

namespace ringfence::dds {

/// The links of a node process with other node processes of its World: messages between CD nodes go directly, not
/// through the process of the World.
///
/// A link is a TCP connection for one direction. The sender opens it with its first message for that node, so only
/// nodes that exchange messages have links. The World sends each node the incarnations and addresses of the others with
/// the assignment. A receiver takes messages only from links of assigned incarnations, so what a lost node sends later
/// is refused.
///
/// The sender never waits: what the network does not take stays in memory until the frame of the receiver goes on, at
/// most the messages of a frame. If a peer closes its end, does not acknowledge bytes within the timeout or breaks the
/// format, the link has failed, and the World decides which node is lost.
///
/// Threads: one, which calls all functions. An own thread only waits for events and calls `wake`.
class PeerLinks {
 public:
  /// `wake` is called by the own thread when receive() or flush() may find work. `timeout_ms` is the time within which
  /// a peer must acknowledge sent bytes. Throws Error if no port or no thread is available.
  PeerLinks(std::uint64_t incarnation, std::uint32_t first_port, std::uint32_t last_port, double timeout_ms,
            std::function<void()> wake);
  ~PeerLinks();
  PeerLinks(const PeerLinks&) = delete;
  PeerLinks& operator=(const PeerLinks&) = delete;

  /// The port at which other nodes reach this one.
  std::uint32_t port() const { return listener_.port(); }
  /// Whether events have arrived since the last receive(). Any thread may call it.
  bool has_events() const noexcept { return events_.load(std::memory_order_relaxed); }

  /// Sets the nodes of the next frame, by slot. Links of incarnations that are not among them are closed.
  void assign(std::span<const PeerRecord> peers);
  /// Whether the node in that slot is reached by a link.
  bool reaches(NodeNumber slot) const noexcept { return slot < peers_.size() && peers_[slot].record.incarnation != 0; }

  /// Collects a message for the node in that slot. Precondition: reaches(slot).
  void add(NodeNumber slot, std::span<const std::byte> message);
  /// Sends what was collected, as far as the network takes it.
  void flush();

  /// Passes received messages to `deliver(slot, message)`, per sender in order. If it returns false, this message and
  /// the later ones of its sender are passed again by the next call. Returns whether any message was passed.
  template <class Deliver>
  bool receive(Deliver deliver);
  /// Whether messages that deliver() did not take wait for the next receive().
  bool has_held() const noexcept { return held_; }
  /// The sender in that slot breaks the protocol: nothing more is received from it.
  void fail(NodeNumber slot);
  /// Calls visit(peer record) for each peer whose link has failed since the last call.
  template <class Visit>
  void take_failures(Visit visit);

 private:
  /// What the sender writes first.
  struct Hello {
    std::uint64_t magic = 0x52464c494e4b3031;  // "RFLINK01"
    std::uint64_t sender = 0, receiver = 0;    ///< incarnations
  };
  struct Peer {
    PeerRecord record;
    LinkSocket out;
    std::vector<std::byte> unsent;
    std::size_t sent = 0;  ///< of `unsent`
    bool failed = false;
    bool failure_taken = false;
  };
  struct Incoming {
    LinkSocket socket;
    std::uint64_t sender = 0;  ///< incarnation; 0: its hello has not arrived
    std::vector<std::byte> bytes;
    std::size_t taken = 0;  ///< of `bytes`
    bool closed = false;
  };

  static constexpr NodeNumber no_slot = 0xffffffffu;
  /// Unprocessed bytes of one link, of an assigned and of another node; the rest stays in the network.
  static constexpr std::size_t max_buffered = std::size_t{1} << 22;
  static constexpr std::size_t max_unknown = std::size_t{1} << 12;

  void wait_for_events();
  void watch(const LinkSocket& socket) const;
  void accept_all();
  void find_closed();
  void read(Incoming& link, std::size_t most);
  bool read_hello(Incoming& link);
  NodeNumber slot_of(std::uint64_t incarnation) const noexcept;
  void send(Peer& peer);
  static std::span<const std::byte> next_message(const Incoming& link, bool& is_valid) noexcept;
  static void drop_taken(Incoming& link);
  void erase_finished();

  std::uint64_t incarnation_;
  double timeout_ms_;
  std::function<void()> wake_;
  LinkSocket listener_;
  int events_set_ = -1;  ///< epoll
  int end_event_ = -1;   ///< ends the own thread
  std::atomic<bool> events_{false};
  std::vector<Peer> peers_;  ///< by slot
  std::vector<Incoming> incoming_;
  bool held_ = false;
  std::thread waiter_;
};

template <class Deliver>
bool PeerLinks::receive(Deliver deliver) {
  if (events_.exchange(false, std::memory_order_acquire)) {
    accept_all();
    find_closed();
  } else if (!held_) {
    return false;
  }
  bool any = false;
  held_ = false;
  for (Incoming& link : incoming_) {
    read(link, max_unknown);
    const NodeNumber slot = link.sender != 0 ? slot_of(link.sender) : no_slot;
    if (slot != no_slot) {
      read(link, max_buffered);
    }
    bool is_valid = true;
    bool taken = slot != no_slot;
    while (taken && !peers_[slot].failed) {
      const std::span<const std::byte> message = next_message(link, is_valid);
      if (message.empty()) {
        break;
      }
      taken = deliver(slot, message);
      link.taken += taken ? sizeof(Packing) + (message.size() + 7) / 8 * 8 : 0;
      any |= taken;
    }
    held_ |= slot != no_slot && !taken;
    drop_taken(link);
    if (slot != no_slot && (!is_valid || (link.closed && taken))) {
      fail(slot);
    }
  }
  erase_finished();
  return any;
}

template <class Visit>
void PeerLinks::take_failures(Visit visit) {
  for (Peer& peer : peers_) {
    if (peer.failed && !std::exchange(peer.failure_taken, true)) {
      visit(peer.record);
    }
  }
}

}  // namespace ringfence::dds
