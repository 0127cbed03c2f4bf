#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "link/atomics.hpp"
#include "link/doorbell.hpp"
#include "link/ring_reader.hpp"
#include "link/ring_writer.hpp"

namespace ringfence::link {

/// The sending end of a one-way channel. Used by one thread at a time.
///
/// A message is written where claim() says: in the ring, or in the stage if it is small (see RingWriter). Claim room,
/// fill it, and commit the bytes used. publish() makes all committed messages visible at once. Never blocks. When a
/// claim finds no room, it publishes what is staged, requests that the receiver rings this thread's doorbell at its
/// next release, and returns an empty span.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicSender {
 public:
  using Bell = BasicDoorbell<Policy>;

  /// `bell` is the receiver's doorbell; null if no thread sleeps on it. `stage` is empty or as MessageStage demands.
  BasicSender(Ring<Policy> ring, Bell* bell, std::span<std::byte> stage = {}) noexcept
      : writer_(ring, stage), bell_(bell) {}
  BasicSender(const BasicSender&) = delete;
  BasicSender& operator=(const BasicSender&) = delete;

  /// From now on another thread receives, and this is its doorbell. The bell is not rung for earlier messages.
  void set_bell(Bell* bell) noexcept { bell_ = bell; }

  /// While quiet, publish() rings no doorbell: the caller wakes the receiver by other means, also if a claim finds no
  /// room.
  void set_quiet(bool quiet) noexcept { quiet_ = quiet; }
  /// Rings the receiver's doorbell if anything was published while quiet since the last call.
  void ring_unrung() noexcept {
    if (std::exchange(unrung_, false) && bell_) bell_->ring();
  }
  /// Whether anything was published while quiet since the last call.
  bool take_unrung() noexcept { return std::exchange(unrung_, false); }

  /// Returns room for a message of up to `bytes` bytes (1 to largest_message()): uninitialised, aligned to 8 bytes,
  /// often to a cache line. Empty if there is no room now, or if the receiver has closed (see closed()). Valid until
  /// commit(), or until the next claim, which replaces it.
  std::span<std::byte> claim(std::size_t bytes) noexcept {
    if (std::byte* room = writer_.claim(bytes)) [[likely]]
      return {room, bytes};
    return claim_when_full(bytes);
  }

  /// Ends the message after the first `used` bytes of the claim; the receiver sees exactly that length. 0 cancels the
  /// claim. The message is staged: it is not visible before publish().
  void commit(std::size_t used) noexcept { writer_.commit(used); }

  /// Makes all staged messages visible to the receiver by one store and rings its doorbell once. Does nothing if no
  /// message is staged.
  void publish() noexcept {
    if (writer_.staged() == 0) return;
    writer_.publish();
    ring_receiver();
  }

  /// Bytes staged but not yet published, including headers and padding.
  std::uint64_t staged() const noexcept { return writer_.staged(); }

  /// Whether the receiver has closed: no further message is read.
  bool closed() const noexcept { return writer_.reader_closed(); }

  /// Size in bytes of the longest message: half the ring, at most 64 KiB.
  std::size_t largest_message() const noexcept { return writer_.largest_message(); }

  /// Publishes what is staged and marks the end of the stream. Afterwards only closed() may be called.
  void close() noexcept {
    writer_.close();
    if constexpr (Policy::defect == Defect::close_without_ring) return;
    ring_receiver();
  }

 private:
  [[gnu::noinline]] std::span<std::byte> claim_when_full(std::size_t bytes) noexcept;

  void ring_receiver() noexcept {
    if (quiet_) {
      unrung_ = true;
    } else if (bell_) {
      bell_->ring();
    }
  }

  RingWriter<Policy> writer_;
  Bell* bell_;
  bool quiet_ = false;
  bool unrung_ = false;  ///< something was published while quiet
};

/// The receiving end of a one-way channel. Used by one thread at a time.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicReceiver {
 public:
  using Bell = BasicDoorbell<Policy>;

  /// `bell` is the sender's doorbell; null if the sender never waits.
  BasicReceiver(Ring<Policy> ring, Bell* bell) noexcept : reader_(ring), bell_(bell) {}
  BasicReceiver(const BasicReceiver&) = delete;
  BasicReceiver& operator=(const BasicReceiver&) = delete;

  /// From now on another thread sends, and this is its doorbell. The bell is not rung for room that was released
  /// earlier.
  void set_bell(Bell* bell) noexcept { bell_ = bell; }

  /// The next unread message, in place; empty if there is none yet. Valid until release().
  std::span<const std::byte> next() noexcept {
    if (!reader_.available()) return {};
    if constexpr (Policy::defect == Defect::early_release) {
      const std::span<const std::byte> message = reader_.next();
      release();
      return message;
    }
    return reader_.next();
  }

  /// What next() will return; empty if there is no message yet. Valid until release().
  std::span<const std::byte> peek() noexcept {
    if (!reader_.available()) return {};
    return reader_.peek();
  }

  /// Whether next() would return a message. The condition that the owner of a doorbell waits for.
  bool has_message() noexcept { return reader_.available(); }

  /// Prefetches the lines that has_message() and next() read: for threads that poll many channels one after the other.
  void prefetch() const noexcept { reader_.prefetch(); }

  /// Releases the room of the messages that next() has returned, and rings a sender that waits for room. Messages of
  /// one length that were published together are released together, when next() has returned the last of them.
  void release() noexcept {
    if (reader_.release() && bell_ && Policy::defect != Defect::waiting_sender_not_rung) bell_->ring();
  }

  /// Whether the sender has closed and next() has returned its last message, as seen by the last call of next() or
  /// has_message() that found no message.
  bool closed() const noexcept { return reader_.ended(); }

  /// Closes the channel from this end: no further message is read. Rings the sender. No other call may follow.
  void close() noexcept {
    reader_.close();
    if constexpr (Policy::defect == Defect::close_without_ring) return;
    if (bell_) bell_->ring();
  }

 private:
  RingReader<Policy> reader_;
  Bell* bell_;
};

template <class Policy>
std::span<std::byte> BasicSender<Policy>::claim_when_full(std::size_t bytes) noexcept {
  assert(bytes >= 1 && bytes <= writer_.largest_message());
  if (std::byte* room = writer_.claim_after_refresh(bytes)) return {room, bytes};
  // The receiver may be waiting for the staged messages. It cannot release room before it sees them.
  if constexpr (Policy::defect != Defect::no_publish_when_full) publish();
  if (std::byte* room = writer_.claim_or_request_ring(bytes)) return {room, bytes};
  return {};
}

/// The sending end of a channel between threads.
class Sender : public BasicSender<ThreadAtomics> {
 public:
  using BasicSender::BasicSender;
};

/// The receiving end of a channel between threads.
class Receiver : public BasicReceiver<ThreadAtomics> {
 public:
  using BasicReceiver::BasicReceiver;
};

/// A one-way channel between two threads, or within one: the ring's memory and its two ends.
///
/// Not copyable or movable, because roles keep pointers to both ends. Must outlive every use of its ends; the doorbells
/// must outlive the channel.
class Channel {
 public:
  /// Allocates a ring of `bytes` bytes, a power of two from 4096 to 2^30, and makes all its pages resident. Throws
  /// Error, naming `option`, for any other size. Senders of rings of at least 128 KiB have a stage. `receivers_bell` is
  /// rung by publish(), `senders_bell` by a release that a sender waits for. Either may be null; both may be the same
  /// if one thread owns both ends.
  Channel(std::size_t bytes, Doorbell* receivers_bell, Doorbell* senders_bell, const char* option = "--ring-bytes");

  Sender& sender() noexcept { return sender_; }
  Receiver& receiver() noexcept { return receiver_; }

  /// Throws the error that the constructor would throw for `bytes`; does nothing for a valid size.
  static void check(std::size_t bytes, const char* option = "--ring-bytes");

 private:
  /// The stage holds more than is published at once by those who send many small messages, and fits into a first-level
  /// cache. A smaller ring has none: there may be many such rings.
  static constexpr std::size_t stage_bytes_of(std::size_t ring_bytes) noexcept {
    return ring_bytes < std::size_t{1} << 17 ? 0 : 8192;
  }

  struct Free {
    void operator()(void* memory) const noexcept;
  };

  std::unique_ptr<void, Free> memory_;
  Sender sender_;
  Receiver receiver_;
};

}  // namespace ringfence::link
