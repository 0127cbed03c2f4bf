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

/// Before each message in a parcel: 8 bytes. The message follows, filled up to a multiple of 8. Whom it is from and for
/// it says itself (messages::Header).
struct Packing {
  std::uint32_t bytes;  ///< of the message
  std::uint32_t reserved;
};
static_assert(sizeof(Packing) == 8);

/// One end of the way between the World's process and a node's: parcels out, parcels in, both in order and none lost.
///
/// Messages that are taken out of rings are gathered and written as one sample where the sender stops for now, or where
/// the next might not fit: one parcel a stage of the frame, not one a message. At most `window` parcels are on their
/// way that the other end has not said to have taken; then the way is full, and what comes next stays in its ring. So a
/// full way is a full link: nothing waits, nothing is dropped, and what lies in DDS's own caches is bounded. Every
/// parcel says what its sender has taken; who has taken half a window without having anything to say, says that alone.
///
/// Threads: one. Memory: 64 KiB, and while a ring has no room the parcels that wait for it.
class ParcelChannel {
 public:
  static constexpr std::uint64_t window = 32;
  static constexpr std::size_t most_bytes = 60'000;  ///< of a parcel: with its headers, a datagram

  struct Counters {
    std::uint64_t sent_parcels = 0, sent_bytes = 0;
    std::uint64_t received_parcels = 0, received_bytes = 0;
    std::uint64_t refused_writes = 0;
    std::uint64_t answers = 0;    ///< times that something came after something was sent
    std::uint64_t answer_ns = 0;  ///< from the first that was sent until then, summed
    std::uint64_t answer_ns_max = 0;
  };

  /// `incarnation` is the node's; it marks all that passes either way. The writer outlives the path.
  ParcelChannel(dds_entity_t writer, std::uint64_t incarnation);

  std::uint64_t incarnation() const noexcept { return incarnation_; }
  /// From any thread.
  Counters counters() const noexcept;
  /// Parcels with a number that were sent so far.
  std::uint64_t sent() const noexcept { return sent_; }
  /// The number of shapes that the World has, as parcels say. From any thread.
  void set_shapes(std::uint32_t shapes) noexcept { shapes_.store(shapes, std::memory_order_relaxed); }

  // Out.
  /// Takes what can be read from `in`. False where the way is full before the end.
  bool gather(link::Receiver& in);
  /// Adds one message. False, and nothing is added, where the way is full.
  bool add(std::span<const std::byte> message);
  /// Writes what was gathered. False where the way is full.
  bool flush();
  /// Queues something other than messages; it goes behind what was gathered before, and ahead of what comes later.
  void say(ParcelKind kind, std::span<const std::byte> bytes);
  /// Something that is not numbered, at once; lost where it cannot be written.
  void send_unnumbered(ParcelKind kind);
  bool has_to_send() const noexcept { return !batch_.empty() || !queued_.empty(); }

  // In.
  /// Notes what the parcel says, and shows it to `deliver(kind, shapes, offset, bytes)` without copying it; where that
  /// answers false the parcel is kept, and those behind it. `deliver` moves `offset` on past what it has dealt with.
  /// False where a parcel before this one is missing: the way is broken.
  template <class Deliver>
  bool receive(const ParcelSample& parcel, Deliver& deliver);
  /// Shows what was kept, in order, as long as `deliver` answers true. Whether anything was dealt with.
  template <class Deliver>
  bool deliver_held(Deliver& deliver);
  bool has_held() const noexcept { return !held_.empty(); }
  /// Says what was taken if that is due and nothing else says it.
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
  bool note(const ParcelSample& parcel);
  void taken(std::size_t bytes) noexcept;

  dds_entity_t writer_;
  std::uint64_t incarnation_;
  std::atomic<std::uint32_t> shapes_{0};
  std::vector<std::byte> batch_;
  std::deque<QueuedParcel> queued_;
  std::deque<HeldParcel> held_;
  std::uint64_t sent_ = 0;               ///< parcels with a number
  std::uint64_t sent_acknowledged_ = 0;  ///< of them, taken by the other end
  std::uint64_t received_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t acknowledgement_sent_ = 0;
  std::uint64_t unanswered_since_ns_ = 0;  ///< when the first parcel after the last that came was sent; 0: none was

  /// Written by the path's thread alone, so a load and a store do.
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

/// Shows each message of a parcel from `offset` on to `see(message)` until that answers false; moves `offset`
/// behind the last that was dealt with. False where it stopped; what is no message ends the parcel.
template <class See>
bool for_each_message(std::span<const std::byte> bytes, std::size_t& offset, See see) {
  while (bytes.size() - offset >= sizeof(Packing)) {
    Packing packing;
    std::memcpy(&packing, bytes.data() + offset, sizeof packing);
    const std::size_t begin = offset + sizeof packing;
    if (packing.bytes == 0 || packing.bytes > bytes.size() - begin) {
      break;
    }
    if (!see(bytes.subspan(begin, packing.bytes))) {
      return false;
    }
    offset = std::min(bytes.size(), begin + (std::size_t{packing.bytes} + 7) / 8 * 8);
  }
  offset = bytes.size();
  return true;
}

/// Copies a message into a ring, unpublished. False where there is no room now; what no message of that ring can be is
/// left out.
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
  if (!note(parcel)) {
    return false;
  }
  if (parcel.number == 0) {
    return true;
  }
  const auto kind = static_cast<ParcelKind>(parcel.kind);
  const auto bytes = bytes_of(parcel.bytes);
  std::size_t offset = 0;
  if (held_.empty() && deliver(kind, parcel.shapes, offset, bytes)) {
    taken(bytes.size());
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
    taken(first.bytes.size());
    held_.pop_front();
  }
  return any;
}

}  // namespace ringfence::dds
