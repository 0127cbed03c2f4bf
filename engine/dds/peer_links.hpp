#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/numbers.hpp"
#include "dds/link_events.hpp"
#include "dds/link_stream.hpp"
#include "dds/wire.hpp"
#include "facade/config_check.hpp"

namespace ringfence::dds {

/// The links of a node process with other node processes of its World: messages between CD nodes go directly, not
/// through the process of the World.
///
/// A link is a LinkStream for one direction. The sender opens it with its first message for that node, so only
/// nodes that exchange messages have links. The World sends each node the incarnations and addresses of the others with
/// the assignment. A receiver takes messages only from links of assigned incarnations, so what a lost node sends later
/// is refused.
///
/// The sender never waits: what the link does not take stays in memory until the frame of the receiver goes on, at
/// most the messages of a frame. If a peer closes its end, does not respond or breaks the format, the link has failed,
/// and the World decides which node is lost.
///
/// The World opens the link for its parcels in the same way; this class only accepts it.
///
/// Threads: one.
class PeerLinks {
 public:
  /// Listens at the first free port of the range, and locally with the incarnation as the name. Throws Error if no port
  /// is available.
  PeerLinks(std::uint64_t incarnation, std::uint64_t world, std::uint32_t first_port, std::uint32_t last_port);
  PeerLinks(const PeerLinks&) = delete;
  PeerLinks& operator=(const PeerLinks&) = delete;

  /// The port at which the World and other nodes reach this one.
  std::uint32_t port() const { return listener_.port(); }
  /// Has events when receive() or flush() may find work.
  const LinkEvents& events() const noexcept { return events_; }

  /// Returns the World's link once, after a receive() that has found it, with the bytes of its parcels that were
  /// received already.
  std::optional<LinkStream> take_world_link() noexcept { return std::exchange(world_link_, std::nullopt); }

  /// Sets the nodes of the next frame, by slot. Links of incarnations that are not among them are closed.
  void assign(std::span<const PeerRecord> peers);
  /// Whether the node in that slot is reached by a link.
  bool reaches(NodeNumber slot) const noexcept { return slot < peers_.size() && peers_[slot].record.incarnation != 0; }

  /// Collects a message for the node in that slot. Precondition: reaches(slot).
  void add(NodeNumber slot, std::span<const std::byte> message);
  /// Sends what was collected, as far as the links take it.
  void flush();
  /// Whether the links have not taken everything.
  bool has_unsent() const noexcept;

  /// Takes the events that have arrived: new links, links with data, and links that were closed.
  void take_events();
  /// Whether bytes have arrived in shared memory since the last receive(). Makes no system call.
  bool has_news() const noexcept;
  /// Reads the links that had events, and shared memory. Passes received messages to `deliver(slot, message)`, per
  /// sender in order. If it returns false, this message and the later ones of its sender are passed again by the next
  /// call. Returns whether any message was passed.
  ///
  /// The bytes are in place: the sender may change them meanwhile, see LinkStream::received().
  template <class Deliver>
  bool receive(Deliver deliver);
  /// The first message of what a link has received after its hello. Empty if it is not complete or if its length is not
  /// valid; then sets `is_valid` to false. For any bytes. Valid as long as `received`.
  static std::span<const std::byte> first_message(std::span<const std::byte> received, bool& is_valid) noexcept;
  /// The sender in that slot breaks the protocol: nothing more is received from it.
  void fail(NodeNumber slot);
  /// Calls visit(peer record) for each peer whose link has failed since the last call.
  template <class Visit>
  void take_failures(Visit visit);

  // Sleeping; see LinkStream.
  /// Requests an event for room for what is not sent and, with `awaits_messages`, for messages that arrive. Returns
  /// false if there is something already.
  [[nodiscard]] bool arm(bool awaits_messages) noexcept;
  void disarm() noexcept;

 private:
  struct Peer {
    PeerRecord record;
    LinkStream out;
    bool failed = false;
    bool failure_taken = false;
  };
  struct Incoming {
    LinkStream stream;
    std::uint64_t sender = 0;  ///< incarnation; 0: its hello has not arrived
    bool has_messages = true;  ///< there may be messages that were not taken
  };

  static constexpr NodeNumber no_slot = 0xffffffffu;
  /// Bytes of one link that are read and not processed, of an assigned and of another node; the rest stays in the link.
  static constexpr std::size_t max_buffered = std::size_t{1} << 22;
  static constexpr std::size_t max_unknown = std::size_t{1} << 12;
  /// Links that are accepted at the same time.
  static constexpr std::size_t max_incoming = 2 * std::size_t{facade::max_nodes};

  void accept_all(const LinkSocket& listener);
  void note_events(std::uint64_t tag);
  bool read(Incoming& link);
  bool read_hello(Incoming& link);
  NodeNumber slot_of(std::uint64_t incarnation) const noexcept;
  LinkStream::RingBytes rings() const noexcept;
  bool make_room();
  void erase_finished();

  std::uint64_t incarnation_;
  std::uint64_t world_;
  bool world_came_ = false;
  std::optional<LinkStream> world_link_;
  LinkSocket listener_;
  LinkSocket local_listener_;  ///< empty if the system has no local sockets
  LinkEvents events_;          ///< of the listeners and of all links, with their sockets' numbers as tags
  std::vector<Peer> peers_;    ///< by slot
  std::vector<Incoming> incoming_;
};

template <class Deliver>
bool PeerLinks::receive(Deliver deliver) {
  bool any = false;
  for (Incoming& link : incoming_) {
    if (!read(link) && !std::exchange(link.has_messages, false)) {
      continue;
    }
    const NodeNumber slot = link.sender != 0 ? slot_of(link.sender) : no_slot;
    bool is_valid = true;
    bool taken = slot != no_slot;
    while (taken && !peers_[slot].failed) {
      const std::span<const std::byte> message = first_message(link.stream.received(), is_valid);
      if (message.empty()) {
        break;
      }
      taken = deliver(slot, message);
      link.stream.take(taken ? sizeof(Packing) + (message.size() + 7) / 8 * 8 : 0);
      any |= taken;
    }
    link.stream.release();
    link.has_messages = slot != no_slot && !taken;
    if (slot != no_slot && (!is_valid || (link.stream.is_closed() && taken))) {
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
