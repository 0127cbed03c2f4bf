#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "link/atomics.hpp"
#include "link/doorbell.hpp"
#include "link/ring.hpp"

namespace ringfence::link {

/// The sending end of a one-way link: one thread's.
///
/// A message is written where it will be read: claim room, fill it, commit what was used, and when all that is to be
/// said now is said, publish. Never blocks: a claim that finds no room returns an empty span, has published what was
/// staged, and has asked the receiver to ring this thread's doorbell when it releases.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicSender {
 public:
  using Bell = BasicDoorbell<Policy>;

  /// `bell` is the receiver's; null where nobody sleeps on it.
  BasicSender(Ring<Policy> ring, Bell* bell) noexcept : writer_(ring), bell_(bell) {}
  BasicSender(const BasicSender&) = delete;
  BasicSender& operator=(const BasicSender&) = delete;

  /// Room for a message of up to `bytes` bytes (1 to largest_message()), uninitialised, aligned to 8 bytes and often to
  /// a cache line; empty when there is none now, or the receiver is gone (see closed()). Valid until commit, or until
  /// the next claim, which replaces it.
  std::span<std::byte> claim(std::size_t bytes) noexcept {
    if (std::byte* room = writer_.claim(bytes)) [[likely]]
      return {room, bytes};
    return claim_when_full(bytes);
  }

  /// Ends the message after the first `used` bytes of the claim: the receiver sees exactly that length. 0 gives the
  /// claim up. The message is staged: nobody sees it before publish().
  void commit(std::size_t used) noexcept { writer_.commit(used); }

  /// Shows the receiver everything staged, by one store, and rings its doorbell once; does nothing where nothing is
  /// staged.
  void publish() noexcept {
    if (writer_.staged() == 0) return;
    writer_.publish();
    ring_receiver();
  }

  /// Bytes staged but not published yet, with headers and padding.
  std::uint64_t staged() const noexcept { return writer_.staged(); }

  /// Whether the receiver is gone: nothing sent any more will be read.
  bool closed() const noexcept { return writer_.reader_closed(); }

  /// The longest message: half the ring, 64 KiB at most.
  std::size_t largest_message() const noexcept { return writer_.largest_message(); }

  /// Publishes what is staged and says that no message follows. Call nothing but closed() after it.
  void close() noexcept {
    writer_.close();
    if constexpr (Policy::defect == Defect::close_without_ring) return;
    ring_receiver();
  }

 private:
  [[gnu::noinline]] std::span<std::byte> claim_when_full(std::size_t bytes) noexcept;

  void ring_receiver() noexcept {
    if (bell_) bell_->ring();
  }

  RingWriter<Policy> writer_;
  Bell* bell_;
};

/// The receiving end of a one-way link: one thread's.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicReceiver {
 public:
  using Bell = BasicDoorbell<Policy>;

  /// `bell` is the sender's; null where it never waits.
  BasicReceiver(Ring<Policy> ring, Bell* bell) noexcept : reader_(ring), bell_(bell) {}
  BasicReceiver(const BasicReceiver&) = delete;
  BasicReceiver& operator=(const BasicReceiver&) = delete;

  /// The next unread message where it lies, or empty where there is none yet. Lives until release().
  std::span<const std::byte> next() noexcept {
    if (!reader_.available()) return {};
    if constexpr (Policy::defect == Defect::early_release) {
      const std::span<const std::byte> message = reader_.next();
      release();
      return message;
    }
    return reader_.next();
  }

  /// Whether next() would return a message: what a doorbell's owner waits for.
  bool has_message() noexcept { return reader_.available(); }

  /// Asks for the lines that has_message() and next() look at, for who looks at many links, one after the other.
  void prefetch() const noexcept { reader_.prefetch(); }

  /// Gives back the room of everything that next() returned, and rings a sender that waits for room.
  void release() noexcept {
    if (reader_.release() && bell_ && Policy::defect != Defect::waiting_sender_not_rung) bell_->ring();
  }

  /// Whether the sender has closed and next() has returned its last message; as of the last next() or has_message()
  /// that found none.
  bool closed() const noexcept { return reader_.ended(); }

  /// Says that nothing more will be read, and rings the sender. Call nothing after it.
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
  // What is staged may be what the receiver waits for; it frees nothing that it does not know of.
  if constexpr (Policy::defect != Defect::no_publish_when_full) publish();
  if (std::byte* room = writer_.claim_or_request_ring(bytes)) return {room, bytes};
  return {};
}

/// The sending end of a link between threads.
class Sender : public BasicSender<ThreadAtomics> {
 public:
  using BasicSender::BasicSender;
};

/// The receiving end of a link between threads.
class Receiver : public BasicReceiver<ThreadAtomics> {
 public:
  using BasicReceiver::BasicReceiver;
};

/// A one-way link between two threads, or within one: the ring's memory and its two ends.
///
/// Neither copied nor moved: both ends are pointed to. Outlives every use of them, and the doorbells outlive it.
class Channel {
 public:
  /// A ring of `bytes` bytes, a power of two from 4096 to 2^31; throws Error, naming `option`, otherwise.
  /// `receivers_bell` is rung by publish, `senders_bell` by a release that a sender waits for; either may be null, and
  /// both may be the same where one thread steps both ends.
  Channel(std::size_t bytes, Doorbell* receivers_bell, Doorbell* senders_bell, const char* option = "--ring-bytes");

  Sender& sender() noexcept { return sender_; }
  Receiver& receiver() noexcept { return receiver_; }

  /// Throws what the constructor would throw for `bytes`.
  static void check(std::size_t bytes, const char* option = "--ring-bytes");

 private:
  struct Free {
    void operator()(void* memory) const noexcept;
  };

  std::unique_ptr<void, Free> memory_;
  Sender sender_;
  Receiver receiver_;
};

}  // namespace ringfence::link
