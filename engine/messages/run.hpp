#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>

#include "link/channel.hpp"
#include "messages/header.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::messages {

using TrafficCounts = std::array<TrafficReport, traffic_count>;

/// What all messages of one run share.
struct RunHeader {
  MessageType type = MessageType::frame_done;
  Endpoint source;
  Endpoint destination;
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;
};

/// Writes a message's header. `total` is the run's where this message is its last, else 0 and `last` is false.
inline void write_header(std::byte* where, const RunHeader& head, std::size_t bytes_each, std::size_t count, bool last,
                         std::size_t total) noexcept {
  Header header;
  header.type = static_cast<std::uint16_t>(head.type);
  header.record_bytes = static_cast<std::uint16_t>(bytes_each);
  header.last = last ? 1 : 0;
  header.source = head.source.value;
  header.destination = head.destination.value;
  header.frame = head.frame;
  header.epoch = head.epoch;
  header.count = static_cast<std::uint32_t>(count);
  header.bytes = static_cast<std::uint32_t>(sizeof(Header) + count * bytes_each);
  header.total = last ? total : 0;
  std::memcpy(where, &header, sizeof(Header));
}

inline void count_message(TrafficCounts& counts, const RunHeader& head, std::size_t bytes_each,
                          std::size_t records) noexcept {
  TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(head.type))];
  ++traffic.messages;
  traffic.records += records;
  traffic.bytes += sizeof(Header) + records * bytes_each;
}

/// A run of records on its way through a link, split over as many messages as it needs, resumable when the link is
/// full. The records are written straight into the link's memory.
///
/// Every run ends with a message that says so and how many records there were, also an empty one. Belongs to one role.
class RunSender {
 public:
  /// Starts a run of `total` records.
  void start(std::size_t total) noexcept {
    total_ = total;
    next_ = 0;
    done_ = false;
  }
  bool done() const noexcept { return done_; }
  /// Gives up what has not been sent yet.
  void stop() noexcept { done_ = true; }

  /// Sends as much as the link takes and publishes it; true when the whole run has gone. `fill(i, where)` writes
  /// record i of `bytes_each` bytes. Cost: one claim a message of at most Sender::largest_message() bytes.
  template <class Fill>
  bool pump(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts, Fill fill) {
    if (done_) {
      return true;
    }
    const std::size_t most = bytes_each == 0 ? 1 : (link.largest_message() - sizeof(Header)) / bytes_each;
    while (!done_) {
      const std::size_t count = std::min(total_ - next_, most);
      const std::size_t bytes = sizeof(Header) + count * bytes_each;
      const std::span<std::byte> room = link.claim(bytes);
      if (room.empty()) {
        break;
      }
      std::byte* where = room.data() + sizeof(Header);
      for (std::size_t i = 0; i < count; ++i, where += bytes_each) {
        fill(next_ + i, where);
      }
      next_ += count;
      done_ = next_ == total_;
      write_header(room.data(), head, bytes_each, count, done_, total_);
      link.commit(bytes);
      count_message(counts, head, bytes_each, count);
    }
    link.publish();
    return done_;
  }

 private:
  std::size_t total_ = 0;
  std::size_t next_ = 0;
  bool done_ = true;
};

/// A run whose records are found one by one, and whose number is known only at its end: each goes into the link as soon
/// as it is there, and is shown when its message is full. So the receiver works on the first while the last are found.
///
/// Belongs to one role, which claims nothing else from the same link between start() and finish().
class RunWriter {
 public:
  /// Messages hold at most `message_bytes`: small ones reach the receiver sooner.
  explicit RunWriter(std::size_t message_bytes = std::size_t{1} << 16) noexcept : message_bytes_(message_bytes) {}

  void start() noexcept {
    room_ = nullptr;
    count_ = most_ = total_ = 0;
    done_ = false;
  }
  bool done() const noexcept { return done_; }
  std::size_t total() const noexcept { return total_; }

  /// Where the next record of `bytes_each` bytes is to be written, or null where the link has no room now: what came
  /// before is published then, and the caller tries again later. The same head and size for all of a run.
  std::byte* add(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts) {
    if (count_ == most_ && !open(link, head, bytes_each, counts)) [[unlikely]] {
      return nullptr;
    }
    ++total_;
    return room_ + sizeof(Header) + count_++ * bytes_each;
  }

  /// Sends the message that is being filled as it is, so that something else may claim from the link.
  void flush(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts) {
    if (room_ != nullptr) {
      close(link, head, bytes_each, counts);
    }
  }

  /// Ends the run: the last message says so. False where the link has no room for it; then again later.
  bool finish(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts) {
    if (done_) {
      return true;
    }
    if (room_ == nullptr) {
      const std::span<std::byte> room = link.claim(sizeof(Header));
      if (room.empty()) {
        return false;
      }
      room_ = room.data();
    }
    done_ = true;
    close(link, head, bytes_each, counts);
    return true;
  }

 private:
  bool open(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts) {
    if (room_ != nullptr) {
      close(link, head, bytes_each, counts);
    }
    const std::size_t most = (std::min(message_bytes_, link.largest_message()) - sizeof(Header)) / bytes_each;
    const std::span<std::byte> room = link.claim(sizeof(Header) + most * bytes_each);
    if (room.empty()) {
      return false;
    }
    room_ = room.data();
    most_ = most;
    return true;
  }

  void close(link::Sender& link, const RunHeader& head, std::size_t bytes_each, TrafficCounts& counts) {
    write_header(room_, head, bytes_each, count_, done_, total_);
    link.commit(sizeof(Header) + count_ * bytes_each);
    link.publish();
    count_message(counts, head, bytes_each, count_);
    room_ = nullptr;
    count_ = most_ = 0;
  }

  std::size_t message_bytes_;
  std::byte* room_ = nullptr;  ///< of the message that is being filled
  std::size_t count_ = 0;      ///< records in it
  std::size_t most_ = 0;
  std::size_t total_ = 0;
  bool done_ = true;
};

}  // namespace ringfence::messages
