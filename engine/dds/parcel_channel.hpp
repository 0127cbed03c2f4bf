#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "dds/link_stream.hpp"
#include "dds/wire.hpp"
#include "link/channel.hpp"

namespace ringfence::dds {

/// One end of the link between the World's process and a node process: parcels in both directions, in order and without
/// loss, over a LinkStream.
///
/// Messages from rings are collected and sent as one parcel when the sender pauses or the next message might not fit.
/// This makes one parcel per stage of the frame instead of one per message. The channel is full while the link does not
/// take what was collected; then further messages stay in their ring. A receiver whose ring is full stops reading. So a
/// full channel acts like a full ring: no thread waits, no message is dropped, and memory stays bounded.
///
/// Threads: one at a time, except where a function states otherwise. Memory: at most 512 KiB, and the rings of the
/// link.
class ParcelChannel {
 public:
  static constexpr std::size_t max_bytes = 60'000;                      ///< of the contents of a parcel
  static constexpr std::size_t max_unsent = std::size_t{1} << 18;       ///< above it the channel is full
  static constexpr std::size_t largest_message = std::size_t{1} << 15;  ///< half of a node's ring

  struct Counters {
    std::uint64_t sent_parcels = 0, sent_bytes = 0;
    std::uint64_t received_parcels = 0, received_bytes = 0;
    std::uint64_t shared_bytes = 0;    ///< of sent_bytes: through memory that both processes share
    std::uint64_t refused_writes = 0;  ///< how often the link did not take all that was to be sent
    std::uint64_t answers = 0;         ///< replies: first parcels received after at least one parcel was sent
    std::uint64_t answer_ns = 0;       ///< sum over the replies of the time since the first parcel that it replies to
    std::uint64_t answer_ns_max = 0;
    std::uint64_t retransmitted_bytes = 0;  ///< by TCP
  };

  /// `hello` is sent before everything else.
  explicit ParcelChannel(LinkStream stream, std::span<const std::byte> hello = {});

  /// See LinkStream::report_to().
  void report_to(const LinkEvents& events, std::uint64_t tag) noexcept { stream_.report_to(events, tag); }
  /// Whether the other end has closed the link, does not respond, or has broken the format. Nothing more is sent or
  /// received.
  bool is_broken() const noexcept { return broken_; }
  /// May be called from any thread.
  Counters counters() const noexcept;
  /// Number of parcels sent.
  std::uint64_t sent() const noexcept { return sent_parcels_.value(); }
  /// Number of parcels received and processed.
  std::uint64_t received() const noexcept { return received_parcels_.value(); }
  /// Sets the number of shapes of the World, which later parcels carry. May be called from any thread.
  void set_shapes(std::uint32_t shapes) noexcept { shapes_.store(shapes, std::memory_order_relaxed); }

  // Sending.
  /// Whether the longest message of a node's ring could be collected now. Sends what was collected if necessary.
  bool has_room() { return stream_.unsent() <= max_unsent || (flush(), stream_.unsent() <= max_unsent); }
  /// Takes messages from `in` and collects them. Returns false if the channel is full before `in` is empty.
  bool gather(link::Receiver& in);
  /// Collects one message, after has_room().
  void add(std::span<const std::byte> message);
  /// Adds a control record as a parcel of its own, after the messages that were collected before.
  void enqueue(ParcelKind kind, std::span<const std::byte> bytes);
  /// Sends what was collected. Returns false if the link does not take all of it; then the rest is kept.
  bool flush();
  /// Whether the link has not taken all that was collected.
  bool has_unsent() const noexcept { return stream_.unsent() != 0; }

  // Receiving.
  /// The socket has events: the next receive() reads it.
  void note_events() noexcept { stream_.note_events(); }
  /// See LinkStream::has_news().
  bool has_news() const noexcept { return stream_.has_news(); }
  /// Reads what has arrived and passes each parcel to `deliver(kind, shapes, offset, bytes)`. `deliver` advances
  /// `offset` past what it has processed. If it returns false, the rest of this parcel and all later ones stay for the
  /// next call, unless the link has ended. Returns whether `deliver` has processed anything.
  ///
  /// The bytes of a parcel of messages are in place: the other process may change them meanwhile, see
  /// LinkStream::received(). Other parcels are copied first.
  template <class Deliver>
  bool receive(Deliver& deliver);

  // Sleeping; see LinkStream.
  [[nodiscard]] bool arm() noexcept { return stream_.arm(); }
  void disarm() noexcept { stream_.disarm(); }

 private:
  bool next_parcel();
  std::span<const std::byte> contents();
  void begin_parcel(ParcelKind kind);
  void end_parcel();
  void end_of_delivery();
  void fail() noexcept;
  void count_received(std::size_t bytes) noexcept;

  static constexpr std::uint64_t no_parcel = ~std::uint64_t{0};
  /// Bytes that are read at once: several parcels, but few enough to stay in the cache until they are processed.
  static constexpr std::size_t max_unread = std::size_t{1} << 17;
  static_assert(max_unread >= 2 * (sizeof(ParcelHeader) + max_bytes));

  LinkStream stream_;
  std::atomic<std::uint32_t> shapes_{0};
  std::uint64_t parcel_ = no_parcel;    ///< position of the header of the parcel that is being collected
  std::optional<ParcelHeader> header_;  ///< of the first received parcel, checked; read once
  std::size_t offset_ = 0;              ///< of what is processed of that parcel
  std::vector<std::byte> control_;      ///< a copy of its bytes, if it does not contain messages
  bool broken_ = false;
  std::uint64_t unanswered_since_ns_ = 0;  ///< time of the first parcel sent after the last one received; 0: none

  /// A counter that one thread changes, so a load and a store suffice. Any thread may read it.
  class Counter {
   public:
    void add(std::uint64_t more) noexcept { value_.store(value() + more, std::memory_order_relaxed); }
    void raise(std::uint64_t to) noexcept { value_.store(std::max(value(), to), std::memory_order_relaxed); }
    std::uint64_t value() const noexcept { return value_.load(std::memory_order_relaxed); }

   private:
    std::atomic<std::uint64_t> value_{0};
  };
  Counter sent_parcels_, sent_bytes_, shared_bytes_, received_parcels_, received_bytes_, refused_writes_;
  Counter answers_, answer_ns_, answer_ns_max_;
};

/// Calls `visit(message)` for each message of a parcel from `offset` on. If `visit` returns false, returns false and
/// sets `offset` to the start of that message. Otherwise returns true and sets `offset` to the end of the parcel.
/// Invalid bytes end the parcel. Another process may change the bytes meanwhile. Precondition: `offset` is at most the
/// size of `bytes`.
template <class Visit>
bool for_each_message(std::span<const std::byte> bytes, std::size_t& offset, Visit visit) {
  while (bytes.size() - offset >= sizeof(Packing)) {
    const auto packing = read_once<Packing>(bytes.subspan(offset));
    const std::size_t begin = offset + sizeof packing;
    if (packing.bytes == 0 || packing.bytes > bytes.size() - begin) {
      break;
    }
    if (!visit(bytes.subspan(begin, packing.bytes))) {
      return false;
    }
    offset = std::min(bytes.size(), begin + (std::size_t{packing.bytes} + 7) / 8 * 8);
  }
  offset = bytes.size();
  return true;
}

/// Copies a message into a ring without publishing it. Returns false if there is no room now. Otherwise returns true;
/// the message is dropped if it can never fit, or if `accept(copy)` is false.
template <class Accept>
bool copy_to_ring(std::span<const std::byte> message, link::Sender& out, Accept accept) {
  if (message.size() > out.largest_message()) {
    return true;
  }
  const std::span<std::byte> room = out.claim(message.size());
  if (room.empty()) {
    return false;
  }
  std::copy(message.begin(), message.end(), room.begin());
  out.commit(accept(std::span<const std::byte>(room)) ? message.size() : 0);
  return true;
}
inline bool copy_to_ring(std::span<const std::byte> message, link::Sender& out) {
  return copy_to_ring(message, out, [](std::span<const std::byte>) { return true; });
}

// The end of the link is noticed also while a parcel cannot be processed: what the parcel waits for may never come.
template <class Deliver>
bool ParcelChannel::receive(Deliver& deliver) {
  bool any = false;
  bool is_blocked = false;
  do {
    while (!is_blocked && next_parcel()) {
      const std::size_t before = offset_;
      is_blocked = !deliver(static_cast<ParcelKind>(header_->kind), header_->shapes, offset_, contents());
      any |= !is_blocked || offset_ != before;
      if (!is_blocked) {
        end_of_delivery();
      }
    }
  } while (stream_.receive(max_unread) && !is_blocked);
  if (stream_.is_closed()) {
    fail();
  }
  return any;
}

}  // namespace ringfence::dds
