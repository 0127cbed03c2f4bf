#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "dds/parcel_channel.hpp"
#include "facade/duplex_channel.hpp"

namespace ringfence::test {

/// One end of a channel between two processes, with one ring to send and one to receive: what the bridge and a node
/// have, without a World.
class ChannelEnd {
 public:
  explicit ChannelEnd(dds::LinkStream link)
      : parcel_channel_(std::move(link)), channel_(std::size_t{1} << 16, nullptr, nullptr) {}

  link::Sender& out() { return channel_.forward.sender(); }
  link::Receiver& in() { return channel_.backward.receiver(); }
  dds::ParcelChannel& parcel_channel() { return parcel_channel_; }

  /// Moves what can be moved now.
  void step() {
    auto show = [this](dds::ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
      return kind != dds::ParcelKind::messages ||
             dds::for_each_message(bytes, offset, [this](std::span<const std::byte> message) {
               return dds::copy_to_ring(message, channel_.backward.sender());
             });
    };
    parcel_channel_.note_events();
    parcel_channel_.receive(show);
    channel_.backward.sender().publish();
    parcel_channel_.gather(channel_.forward.receiver());
    parcel_channel_.flush();
  }

 private:
  dds::ParcelChannel parcel_channel_;
  facade::DuplexChannel channel_;
};

/// For the echo process: it ends when it receives this message of one byte.
inline constexpr std::byte end_marker{0xff};
inline constexpr std::uint32_t loopback = 0x7f000001;
/// Small rings, so that tests fill them.
inline constexpr dds::LinkStream::RingBytes small_rings{std::size_t{1} << 16, std::size_t{1} << 17};
/// Rings that cannot be made, so that a local socket carries the bytes.
inline constexpr dds::LinkStream::RingBytes no_rings{0, 0};

}  // namespace ringfence::test
