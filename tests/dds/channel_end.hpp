#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dds/domain.hpp"
#include "dds/parcel_channel.hpp"
#include "facade/duplex_channel.hpp"

namespace ringfence::test {

/// One end of a channel between two processes, with one ring to send and one to receive: what the bridge and a node
/// have, without a World.
class ChannelEnd {
 public:
  /// `mine` is the topic written, `theirs` the one read.
  ChannelEnd(const dds::NetworkConfig& network, dds::Side side, dds::Topic mine, dds::Topic theirs,
             std::uint64_t incarnation)
      : domain_(network, side),
        writer_(domain_.writer(mine, dds::parcel_qos, {})),
        reader_(domain_.reader(theirs, dds::parcel_qos, {})),
        parcel_channel_(writer_.get(), incarnation),
        channel_(std::size_t{1} << 16, nullptr, nullptr) {}

  link::Sender& out() { return channel_.forward.sender(); }
  link::Receiver& in() { return channel_.backward.receiver(); }
  dds::ParcelChannel& parcel_channel() { return parcel_channel_; }
  std::uint32_t domain() const { return domain_.number(); }
  bool broken() const { return broken_; }

  bool is_matched() const {
    dds_publication_matched_status_t out{};
    dds_subscription_matched_status_t in{};
    dds_get_publication_matched_status(writer_.get(), &out);
    dds_get_subscription_matched_status(reader_.get(), &in);
    return out.current_count > 0 && in.current_count > 0;
  }

  /// Moves what can be moved now.
  void step() {
    auto show = [this](dds::ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
      return kind != dds::ParcelKind::messages ||
             dds::for_each_message(bytes, offset, [this](std::span<const std::byte> message) {
               return dds::copy_to_ring(message, channel_.backward.sender());
             });
    };
    parcel_channel_.deliver_held(show);
    dds::take_all<dds::ParcelSample>(reader_, [&](const dds::ParcelSample& parcel, const dds_sample_info_t& info) {
      broken_ |= info.valid_data && !parcel_channel_.receive(parcel, show);
    });
    channel_.backward.sender().publish();
    parcel_channel_.gather(channel_.forward.receiver());
    parcel_channel_.flush();
    parcel_channel_.acknowledge();
  }

 private:
  dds::Domain domain_;
  dds::Entity writer_;
  dds::Entity reader_;
  dds::ParcelChannel parcel_channel_;
  facade::DuplexChannel channel_;
  bool broken_ = false;
};

/// For the echo process: it ends when it receives this message of one byte.
inline constexpr std::byte end_marker{0xff};

}  // namespace ringfence::test
