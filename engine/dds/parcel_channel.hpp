#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "dds/link_socket.hpp"
#include "dds/wire.hpp"
#include "link/channel.hpp"

namespace ringfence::dds {

/// One end of the link between the World's process and a node process: parcels in both directions, in order and without
/// loss, over TCP.
///
/// Messages from rings are collected and sent as one parcel when the sender pauses or the next message might not fit.
/// This makes one parcel per stage of the frame instead of one per message. The channel is full while the network does
/// not take what was collected; then further messages stay in their ring. A receiver whose ring is full stops reading.
/// So a full channel acts like a full ring: no thread waits, no message is dropped, and memory stays bounded.
///
/// Threads: one at a time, except where a function states otherwise. Memory: about 512 KiB.
class ParcelChannel {
 public:
  static constexpr std::size_t max_bytes = 60'000;                      ///< of the contents of a parcel
  static constexpr std::size_t max_unsent = std::size_t{1} << 18;       ///< above it the channel is full
  static constexpr std::size_t largest_message = std::size_t{1} << 15;  ///< half of a node's ring

  struct Counters {
    std::uint64_t sent_parcels = 0, sent_bytes = 0;
    std::uint64_t received_parcels = 0, received_bytes = 0;
    std::uint64_t refused_writes = 0;  ///< how often the network did not take all that was to be sent
    std::uint64_t answers = 0;         ///< replies: first parcels received after at least one parcel was sent
    std::uint64_t answer_ns = 0;       ///< sum over the replies of the time since the first parcel that it replies to
    std::uint64_t answer_ns_max = 0;
    std::uint64_t retransmitted_bytes = 0;  ///< by TCP
  };

  /// `hello` is sent before everything else; `received` are bytes that were read from the socket before.
  ParcelChannel(LinkSocket socket, std::span<const std::byte> hello, std::span<const std::byte> received);

  const LinkSocket& socket() const noexcept { return socket_; }
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
  bool has_room() { return out_.size() <= max_unsent || (flush(), out_.size() <= max_unsent); }
  /// Takes messages from `in` and collects them. Returns false if the channel is full before `in` is empty.
  bool gather(link::Receiver& in);
  /// Collects one message, after has_room().
  void add(std::span<const std::byte> message);
  /// Adds a control record as a parcel of its own, after the messages that were collected before.
  void enqueue(ParcelKind kind, std::span<const std::byte> bytes);
  /// Sends what was collected. Returns false if the network does not take all of it; then the rest is kept.
  bool flush();
  bool has_to_send() const noexcept { return !out_.empty(); }

  // Receiving.
  /// The socket has events: the next receive() reads it.
  void note_events() noexcept { readable_ = true; }
  /// Reads what has arrived and passes each parcel to `deliver(kind, shapes, offset, bytes)`, without copying.
  /// `deliver` advances `offset` past what it has processed. If it returns false, the rest of this parcel and all later
  /// ones stay for the next call. Returns whether `deliver` has processed anything.
  template <class Deliver>
  bool receive(Deliver& deliver);

 private:
  bool read();
  bool next_parcel(ParcelHeader& header);
  void begin_parcel(ParcelKind kind);
  void end_parcel();
  void fail() noexcept;
  void count_received(std::size_t bytes) noexcept;

  static constexpr std::size_t no_parcel = ~std::size_t{0};

  LinkSocket socket_;
  std::atomic<std::uint32_t> shapes_{0};
  std::vector<std::byte> out_;       ///< not sent
  std::size_t parcel_ = no_parcel;   ///< offset of the header of the parcel that is being collected, in `out_`
  std::vector<std::byte> in_;        ///< of fixed size
  std::size_t begin_ = 0, end_ = 0;  ///< of what is read and not processed, in `in_`
  std::size_t offset_ = 0;           ///< of what is processed of the first parcel
  bool readable_ = true;             ///< the socket may have more
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
  Counter sent_parcels_, sent_bytes_, received_parcels_, received_bytes_, refused_writes_;
  Counter answers_, answer_ns_, answer_ns_max_;
};

/// Calls `visit(message)` for each message of a parcel from `offset` on. If `visit` returns false, returns false and
/// sets `offset` to the start of that message. Otherwise returns true and sets `offset` to the end of the parcel.
/// Invalid bytes end the parcel. Precondition: `offset` is at most the size of `bytes`.
template <class Visit>
bool for_each_message(std::span<const std::byte> bytes, std::size_t& offset, Visit visit) {
  while (bytes.size() - offset >= sizeof(Packing)) {
    Packing packing;
    std::memcpy(&packing, bytes.data() + offset, sizeof packing);
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

/// Copies a message into a ring without publishing it. Returns false if there is no room now. Returns true and drops
/// the message if it can never fit.
inline bool copy_to_ring(std::span<const std::byte> message, link::Sender& out) {
  if (message.size() > out.largest_message()) {
    return true;
  }
  const std::span<std::byte> room = out.claim(message.size());
  if (room.empty()) {
    return false;
  }
  std::copy(message.begin(), message.end(), room.begin());
  out.commit(message.size());
  return true;
}

template <class Deliver>
bool ParcelChannel::receive(Deliver& deliver) {
  bool any = false;
  do {
    ParcelHeader header;
    while (next_parcel(header)) {
      const std::size_t before = offset_;
      const std::span<const std::byte> bytes(in_.data() + begin_ + sizeof header, header.bytes);
      if (!deliver(static_cast<ParcelKind>(header.kind), header.shapes, offset_, bytes)) {
        return any || offset_ != before;
      }
      any = true;
      begin_ += sizeof header + header.bytes;
      offset_ = 0;
      count_received(header.bytes);
    }
  } while (read());
  return any;
}

}  // namespace ringfence::dds
