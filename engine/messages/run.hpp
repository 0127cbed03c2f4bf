#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <type_traits>

#include "link/channel.hpp"
#include "messages/header.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::messages {

/// Messages, records and bytes sent, by Traffic.
using TrafficCounts = std::array<TrafficReport, traffic_count>;

/// The header fields that all messages of a run share.
struct RunHeader {
  MessageType type = MessageType::frame_done;
  Endpoint source;
  Endpoint destination;
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;
};

/// Writes the header of a message of `count` records of `bytes_each` bytes to `out`. If `last` is true, the message
/// ends the run, and the header contains `total`, the number of records of the whole run.
inline void write_header(std::byte* out, const RunHeader& run, std::size_t bytes_each, std::size_t count, bool last,
                         std::size_t total) noexcept {
  Header header;
  header.type = static_cast<std::uint16_t>(run.type);
  header.record_bytes = static_cast<std::uint16_t>(bytes_each);
  header.last = last ? 1 : 0;
  header.source = run.source.value;
  header.destination = run.destination.value;
  header.frame = run.frame;
  header.epoch = run.epoch;
  header.count = static_cast<std::uint32_t>(count);
  header.bytes = static_cast<std::uint32_t>(sizeof(Header) + count * bytes_each);
  header.total = last ? total : 0;
  std::memcpy(out, &header, sizeof(Header));
}

/// Adds a message of `records` records to the counts of its kind of traffic.
inline void count_message(TrafficCounts& counts, const RunHeader& run, std::size_t bytes_each,
                          std::size_t records) noexcept {
  TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(run.type))];
  ++traffic.messages;
  traffic.records += records;
  traffic.bytes += sizeof(Header) + records * bytes_each;
}

/// Sends a run whose number of records is known at its start, in as many messages as needed. Records are written
/// directly into the channel's memory. If the channel is full, the next call of pump() continues the run.
///
/// The last message of a run is marked and has the total number of records; an empty run is one such message. Belongs
/// to one role. Allocates nothing.
class RunSender {
 public:
  /// Starts a run of `total` records.
  void start(std::size_t total) noexcept {
    total_ = total;
    next_ = 0;
    done_ = false;
  }
  /// Whether the whole run is sent or stopped, or none has been started.
  bool done() const noexcept { return done_; }
  /// Cancels the rest of the run.
  void stop() noexcept { done_ = true; }

  /// Sends and publishes as much of the run as the channel has room for. Returns true when done() is true.
  /// `fill(i, out)` writes record i, `bytes_each` bytes, to `out`; it is called once for each record, in order. If
  /// `bytes_each` is 0, the run is empty. Cost: one claim for each message, which has at most Sender::largest_message()
  /// bytes.
  template <class Fill>
  bool pump(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts, Fill fill) {
    if (done_) {
      return true;
    }
    const std::size_t max_records = bytes_each == 0 ? 1 : (link.largest_message() - sizeof(Header)) / bytes_each;
    while (!done_) {
      const std::size_t count = std::min(total_ - next_, max_records);
      const std::size_t bytes = sizeof(Header) + count * bytes_each;
      const std::span<std::byte> room = link.claim(bytes);
      if (room.empty()) {
        break;
      }
      std::byte* out = room.data() + sizeof(Header);
      for (std::size_t i = 0; i < count; ++i, out += bytes_each) {
        fill(next_ + i, out);
      }
      next_ += count;
      done_ = next_ == total_;
      write_header(room.data(), run, bytes_each, count, done_, total_);
      link.commit(bytes);
      count_message(counts, run, bytes_each, count);
    }
    link.publish();
    return done_;
  }
  /// The same for records of one type, without further bytes: `record_at(i)` returns record i.
  template <class RecordAt>
  bool send(link::Sender& link, const RunHeader& run, TrafficCounts& counts, RecordAt record_at) {
    using Record = std::decay_t<std::invoke_result_t<RecordAt, std::size_t>>;
    return pump(link, run, sizeof(Record), counts, [&](std::size_t i, std::byte* out) {
      const Record& record = record_at(i);
      std::memcpy(out, &record, sizeof record);
    });
  }

 private:
  std::size_t total_ = 0;
  std::size_t next_ = 0;
  bool done_ = true;
};

/// Sends a run whose records are produced one at a time, so that their number is known only at the end. Each record is
/// written directly into the channel's memory. A message is published when it is full, so the receiver can process the
/// first records while later records are produced.
///
/// Belongs to one role. Between start() and finish() the role claims nothing else from the same channel, unless it
/// calls flush() first. Allocates nothing.
class RunWriter {
 public:
  /// Messages have at most `message_bytes` bytes; it must be enough for the header and one record. Smaller messages
  /// reach the receiver sooner.
  explicit RunWriter(std::size_t message_bytes = std::size_t{1} << 16) noexcept : message_bytes_(message_bytes) {}

  /// Starts a run.
  void start() noexcept {
    room_ = nullptr;
    count_ = max_count_ = total_ = 0;
    done_ = false;
  }
  /// Whether the run has been finished, or none has been started.
  bool done() const noexcept { return done_; }
  /// Number of records added to the run so far.
  std::size_t total() const noexcept { return total_; }

  /// Adds a record of `bytes_each` bytes, not 0, and returns the place to which the caller writes it before its next
  /// call. Returns null if the channel has no room now: then all earlier records are published, and the caller tries
  /// again later. All calls for a run pass the same header and size.
  std::byte* add(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts) {
    if (count_ == max_count_ && !open(link, run, bytes_each, counts)) [[unlikely]] {
      return nullptr;
    }
    ++total_;
    return room_ + sizeof(Header) + count_++ * bytes_each;
  }

  /// Publishes the incomplete message, if there is one, so that other senders of the role can claim from the channel.
  void flush(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts) {
    if (room_ != nullptr) {
      close(link, run, bytes_each, counts);
    }
  }

  /// Publishes the last message of the run, which is marked. Returns false if the channel has no room now: then the
  /// caller tries again later.
  bool finish(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts) {
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
    close(link, run, bytes_each, counts);
    return true;
  }

 private:
  bool open(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts) {
    if (room_ != nullptr) {
      close(link, run, bytes_each, counts);
    }
    const std::size_t max_records = (std::min(message_bytes_, link.largest_message()) - sizeof(Header)) / bytes_each;
    const std::span<std::byte> room = link.claim(sizeof(Header) + max_records * bytes_each);
    if (room.empty()) {
      return false;
    }
    room_ = room.data();
    max_count_ = max_records;
    return true;
  }

  void close(link::Sender& link, const RunHeader& run, std::size_t bytes_each, TrafficCounts& counts) {
    write_header(room_, run, bytes_each, count_, done_, total_);
    link.commit(sizeof(Header) + count_ * bytes_each);
    link.publish();
    count_message(counts, run, bytes_each, count_);
    room_ = nullptr;
    count_ = max_count_ = 0;
  }

  std::size_t message_bytes_;
  std::byte* room_ = nullptr;  ///< the incomplete message; null if there is none
  std::size_t count_ = 0;      ///< number of records in it
  std::size_t max_count_ = 0;  ///< number of records for which it has room
  std::size_t total_ = 0;
  bool done_ = true;
};

}  // namespace ringfence::messages
