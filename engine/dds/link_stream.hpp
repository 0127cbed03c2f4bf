#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "dds/link_events.hpp"
#include "dds/link_socket.hpp"
#include "dds/shared_rings.hpp"

namespace ringfence::dds {

/// A connection of two processes: bytes in both directions, in order and without loss. Over TCP; between two processes
/// of one machine and user through rings in memory that they share.
///
/// On one machine the link is a local socket, which shows at once when the other process ends. The process that opens
/// it sends a byte with the descriptor of SharedRings, and the other one answers with a byte: whether it has mapped
/// them. From then on a byte on the socket only wakes the other process; it is sent if that process sleeps. If the
/// memory cannot be made or mapped, the socket carries the bytes. If no local socket listens, the link is a TCP
/// connection. The users of a link see no difference.
///
/// Sizes are multiples of 8. The sender never waits: what neither a ring nor the network takes stays in memory.
/// Threads: one.
class LinkStream {
 public:
  /// Sizes of the rings from and to the process that opens the link, in bytes: powers of two, at least 64 KiB. Over
  /// TCP they have no effect.
  struct RingBytes {
    std::size_t out, in;
  };

  /// No link.
  LinkStream() = default;
  /// A link over `socket`, with bytes that were received before.
  explicit LinkStream(LinkSocket socket, std::span<const std::byte> received = {});
  /// A link that another process has opened at a local socket.
  static LinkStream accepted_locally(LinkSocket socket);
  /// Opens a link to a process that listens locally with that name or, on another machine, at that address. No link if
  /// that fails at once.
  static LinkStream connect(LinkAddress to, std::uint64_t local_name, RingBytes rings);
  LinkStream(LinkStream&&) = default;
  LinkStream& operator=(LinkStream&&) = default;

  explicit operator bool() const noexcept { return static_cast<bool>(socket_); }
  const LinkSocket& socket() const noexcept { return socket_; }
  /// Adds the socket to `events`, with that tag. `events` lives as long as the link.
  void report_to(const LinkEvents& events, std::uint64_t tag) noexcept;
  /// Whether the bytes go through memory that both processes share.
  bool is_shared() const noexcept { return rings_ != nullptr; }
  /// Whether the other end has closed the link or has broken its rules, or close() was called: nothing more is sent or
  /// received. received() may still have bytes.
  bool is_closed() const noexcept { return closed_; }
  /// Drops what is not sent and what is received. The other end sees the end of the link when this object ends.
  void close() noexcept;

  // Sending.
  /// Adds bytes, and zeros up to a multiple of 8. They are not sent before flush().
  void append(std::span<const std::byte> bytes);
  /// Number of bytes added so far.
  std::uint64_t appended() const noexcept { return appended_; }
  /// Replaces bytes that were added at that position and were not flushed.
  void replace(std::uint64_t position, std::span<const std::byte> bytes) noexcept;
  /// Sends what was added, and wakes the other process if it sleeps. Returns whether nothing is left.
  bool flush();
  /// Number of bytes that neither a ring nor, by the last flush(), the network has taken.
  std::size_t unsent() const noexcept { return unsent_.size() - sent_; }

  // Receiving.
  /// The socket has events.
  void note_events() noexcept { has_events_ = true; }
  /// Whether bytes have arrived in shared memory since the last receive(). Makes no system call.
  bool has_news() const noexcept { return rings_ != nullptr && rings_->end().has_news(); }
  /// Receives what has arrived, until at most `most` bytes are in received(); a ring has no such limit. Returns whether
  /// it has received anything. Call it again until it has not.
  bool receive(std::size_t most);
  /// What was received and not taken, in place. Valid until receive() or release(). The other process may change the
  /// bytes at any time: read each only once (see read_once()), or copy them first.
  std::span<const std::byte> received() const noexcept;
  /// Removes bytes from the start of received().
  void take(std::size_t bytes) noexcept;
  /// Gives the room of what was taken back to the other end.
  void release();

  // Sleeping.
  /// Requests a byte on the socket when there is something to receive, or room for what is not sent. Returns false if
  /// there is something already. Without shared memory the socket has events in any case.
  [[nodiscard]] bool arm() noexcept { return rings_ == nullptr || closed_ || rings_->end().arm(unsent() != 0); }
  /// The thread is awake: the other end need not send a byte.
  void disarm() noexcept {
    if (rings_ != nullptr) {
      rings_->end().disarm();
    }
  }

 private:
  enum class Handshake : std::uint8_t { done, offered, awaits_offer };

  void offer(RingBytes rings);
  void take_offer();
  void take_answer(std::byte answer);
  void read_signals();
  bool read_socket(std::size_t most);
  bool append_to_ring(std::span<const std::byte> bytes, std::size_t filled) noexcept;
  void fill_ring();
  void send_unsent();
  void erase_sent() noexcept;
  void wake_other() noexcept;
  void update_events() const noexcept;

  LinkSocket socket_;
  std::unique_ptr<SharedRings> rings_;
  Handshake handshake_ = Handshake::done;
  const LinkEvents* events_ = nullptr;
  std::uint64_t tag_ = 0;
  bool has_events_ = true;
  bool closed_ = false;
  std::uint64_t appended_ = 0;
  std::vector<std::byte> unsent_;
  std::size_t sent_ = 0;             ///< of `unsent_`
  std::vector<std::byte> in_;        ///< bytes from the socket
  std::size_t begin_ = 0, end_ = 0;  ///< of what was received and not taken, in `in_`
};

/// A copy of the first bytes of `bytes`, which another process may change at any time: each byte is read once, so what
/// is checked is what is used.
template <class Value>
Value read_once(std::span<const std::byte> bytes) noexcept {
  static_assert(std::is_trivially_copyable_v<Value>);
  Value value;
  std::memcpy(&value, bytes.data(), sizeof value);
  asm volatile("" : : : "memory");  // the compiler must not read the bytes again
  return value;
}

}  // namespace ringfence::dds
