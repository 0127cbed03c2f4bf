#pragma once

#include <cstdint>

namespace ringfence::base {

/// The frame in which something changed last: the low bits of its number.
using FrameStamp = std::uint32_t;

constexpr FrameStamp stamp_of(std::uint64_t frame) noexcept { return static_cast<FrameStamp>(frame); }

/// Whether something with that stamp may have changed after the frame with the stamp `since`. False only if it has not.
/// True also for what has not changed for more than 2^31 frames. Precondition: `since` is at most `max_stamp_age`
/// frames ago.
constexpr bool may_have_changed(FrameStamp stamp, FrameStamp since) noexcept {
  return static_cast<std::int32_t>(stamp - since) > 0;
}
inline constexpr std::uint64_t max_stamp_age = 0x40000000;

}  // namespace ringfence::base
