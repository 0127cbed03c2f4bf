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
struct RunHead {
  MessageType type = MessageType::told;
  Endpoint source;
  Endpoint destination;
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;
};

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

  /// Sends as much as the link takes and publishes it; true when the whole run has gone. `fill(i, where)` writes
  /// record i of `bytes_each` bytes. Cost: one claim a message of at most Sender::largest_message() bytes.
  template <class Fill>
  bool pump(link::Sender& link, const RunHead& head, std::size_t bytes_each, TrafficCounts& counts, Fill fill) {
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
      write_header(room.data(), head, bytes_each, count, bytes);
      link.commit(bytes);
      TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(head.type))];
      ++traffic.messages;
      traffic.records += count;
      traffic.bytes += bytes;
    }
    link.publish();
    return done_;
  }

 private:
  void write_header(std::byte* where, const RunHead& head, std::size_t bytes_each, std::size_t count,
                    std::size_t bytes) const noexcept {
    Header header;
    header.type = static_cast<std::uint16_t>(head.type);
    header.record_bytes = static_cast<std::uint16_t>(bytes_each);
    header.last = done_ ? 1 : 0;
    header.source = head.source.value;
    header.destination = head.destination.value;
    header.frame = head.frame;
    header.epoch = head.epoch;
    header.count = static_cast<std::uint32_t>(count);
    header.bytes = static_cast<std::uint32_t>(bytes);
    header.total = done_ ? total_ : 0;
    std::memcpy(where, &header, sizeof(Header));
  }

  std::size_t total_ = 0;
  std::size_t next_ = 0;
  bool done_ = true;
};

}  // namespace ringfence::messages
