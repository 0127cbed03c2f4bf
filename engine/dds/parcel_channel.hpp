#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <span>
#include <vector>

#include "dds/domain.hpp"
#include "link/channel.hpp"

namespace ringfence::dds {

/// Header of each message in a parcel: 8 bytes. The message follows, padded to a multiple of 8. Its own header
/// (messages::Header) names source and destination.
struct Packing {
  std::uint32_t bytes;  ///< of the message
  std::uint32_t reserved;
};
static_assert(sizeof(Packing) == 8);

/// One end of the connection between the World's process and a node process: parcels in both directions, in order and
/// without loss.
///
/// Messages from rings are collected and written as one sample when the sender pauses or the next message might not
/// fit. This makes one parcel per stage of the frame instead of one per message. The channel is full while `window`
/// parcels are not acknowledged, or DDS takes no sample; then further messages stay in their ring. So a full channel
/// acts like a full ring: no thread waits, no message is dropped, and the caches of DDS stay bounded. Every parcel
/// acknowledges the parcels that its sender has processed. A receiver that has nothing to send acknowledges after half
/// a window.
///
/// Threads: one at a time, except where a function states otherwise. Memory: 128 KiB, plus at most `window` received
/// parcels that wait for room in a ring.
class ParcelChannel {
 public:
  static constexpr std::uint64_t window = 32;
  static constexpr std::size_t max_bytes = 60'000;  ///< of a parcel, so that it fits one datagram with its headers

  struct Counters {
    std::uint64_t sent_parcels = 0, sent_bytes = 0;
    std::uint64_t received_parcels = 0, received_bytes = 0;
    std::uint64_t refused_writes = 0;  ///< writes refused because the window was full or DDS could not take the sample
    std::uint64_t answers = 0;         ///< replies: first parcels received after at least one parcel was sent
    std::uint64_t answer_ns = 0;       ///< sum over the replies of the time since the first parcel that it replies to
    std::uint64_t answer_ns_max = 0;
  };

  /// `incarnation` identifies the node in both directions. The writer outlives the channel.
  ParcelChannel(dds_entity_t writer, std::uint64_t incarnation);

  std::uint64_t incarnation() const noexcept { return incarnation_; }
  /// May be called from any thread.
  Counters counters() const noexcept;
  /// Number of numbered parcels sent.
  std::uint64_t sent() const noexcept { return sent_; }
  /// Sets the number of shapes of the World, which later parcels carry. May be called from any thread.
  void set_shapes(std::uint32_t shapes) noexcept { shapes_.store(shapes, std::memory_order_relaxed); }

  // Sending.
  /// Whether the longest message of a node's ring could be collected now. Writes what was collected if necessary.
  bool has_room();
  /// Takes messages from `in` and collects them. Returns false if the channel is full before `in` is empty.
  bool gather(link::Receiver& in);
  /// Collects one message. Returns false and adds nothing if the channel is full.
  bool add(std::span<const std::byte> message);
  /// Writes what was collected and queued. Returns false if the channel is full; then the rest is kept.
  bool flush();
  /// Queues a control record as a parcel of its own. The parcel follows the messages that were collected before the
  /// call and precedes those that are collected later.
  void enqueue(ParcelKind kind, std::span<const std::byte> bytes);
  /// Sends an unnumbered parcel at once; it is lost if it cannot be written.
  void send_unnumbered(ParcelKind kind);
  bool has_to_send() const noexcept { return !batch_.empty() || !queued_.empty(); }

  // Receiving.
  /// Processes the parcel's acknowledgement and passes its contents to `deliver(kind, shapes, offset, bytes)` without
  /// copying. `deliver` advances `offset` past what it has processed. If it returns false, a copy of this parcel is
  /// held, and so are all later parcels until deliver_held() has passed them on. Returns false if the channel is
  /// broken: an earlier parcel is missing, the parcel is longer than max_bytes, or the sender exceeds the window.
  template <class Deliver>
  bool receive(const ParcelSample& parcel, Deliver& deliver);
  /// Passes held parcels on, in order, until `deliver` returns false. Returns whether `deliver` has processed anything.
  template <class Deliver>
  bool deliver_held(Deliver& deliver);
  bool has_held() const noexcept { return !held_.empty(); }
  /// Sends an acknowledgement if half a window of processed parcels is not acknowledged yet.
  void acknowledge();

 private:
  struct QueuedParcel {
    ParcelKind kind;
    std::vector<std::byte> bytes;
  };
  struct HeldParcel {
    ParcelKind kind;
    std::uint32_t shapes;
    std::size_t offset;
    std::vector<std::byte> bytes;
  };

  bool write(ParcelKind kind, std::span<const std::byte> bytes);
  bool read_header(const ParcelSample& parcel);
  void count_processed(std::size_t bytes) noexcept;

  dds_entity_t writer_;
  std::uint64_t incarnation_;
  std::atomic<std::uint32_t> shapes_{0};
  std::vector<std::byte> batch_;
  std::deque<QueuedParcel> queued_;
  std::deque<HeldParcel> held_;
  std::uint64_t sent_ = 0;               ///< numbered parcels
  std::uint64_t sent_acknowledged_ = 0;  ///< of them, acknowledged by the other end
  std::uint64_t received_ = 0;           ///< numbered parcels
  std::uint64_t processed_ = 0;
  std::uint64_t acknowledgement_sent_ = 0;  ///< number of processed parcels in the last acknowledgement sent
  std::uint64_t unanswered_since_ns_ = 0;   ///< time of the first parcel sent after the last one received; 0: none

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
bool ParcelChannel::receive(const ParcelSample& parcel, Deliver& deliver) {
  if (!read_header(parcel)) {
    return false;
  }
  if (parcel.number == 0) {
    return true;
  }
  const auto kind = static_cast<ParcelKind>(parcel.kind);
  const auto bytes = bytes_of(parcel.bytes);
  if (bytes.size() > max_bytes || held_.size() >= window) {
    return false;
  }
  std::size_t offset = 0;
  if (held_.empty() && deliver(kind, parcel.shapes, offset, bytes)) {
    count_processed(bytes.size());
  } else {
    held_.push_back({kind, parcel.shapes, offset, {bytes.begin(), bytes.end()}});
  }
  return true;
}

template <class Deliver>
bool ParcelChannel::deliver_held(Deliver& deliver) {
  bool any = false;
  while (!held_.empty()) {
    HeldParcel& first = held_.front();
    const std::size_t before = first.offset;
    const bool done = deliver(first.kind, first.shapes, first.offset, std::span<const std::byte>(first.bytes));
    any |= done || first.offset != before;
    if (!done) {
      break;
    }
    count_processed(first.bytes.size());
    held_.pop_front();
  }
  return any;
}

}  // namespace ringfence::dds
