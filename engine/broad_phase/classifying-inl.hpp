// Classifies the slots of a frame: which boxes move, which leave the resting set. Included once for each Highway
// target.

#if defined(RINGFENCE_BROAD_PHASE_CLASSIFYING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_CLASSIFYING_INL
#undef RINGFENCE_BROAD_PHASE_CLASSIFYING_INL
#else
#define RINGFENCE_BROAD_PHASE_CLASSIFYING_INL
#endif

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "broad_phase/kernels.hpp"
#include "broad_phase/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

HWY_INLINE std::uint32_t* append_bits(std::uint64_t mask, std::uint32_t first, std::uint32_t* out) {
  if (mask == ~std::uint64_t{0}) {
    for (std::uint32_t k = 0; k < 64; ++k) out[k] = first + k;
    return out + 64;
  }
  for (; mask != 0; mask &= mask - 1) *out++ = first + static_cast<std::uint32_t>(std::countr_zero(mask));
  return out;
}

inline Kernels::SlotCounts classify_slots(std::span<const std::uint8_t> present, std::span<const std::uint8_t> resting,
                                          const std::uint8_t* in_resting_set, std::uint32_t* moving,
                                          std::uint32_t* leaving) {
  std::uint32_t* const first_moving = moving;
  std::uint32_t* const first_leaving = leaving;
  std::size_t pending = 0;
  const auto block = [&](const std::uint8_t* present_flags, const std::uint8_t* resting_flags,
                         const std::uint8_t* set_flags, std::uint32_t first) {
    const std::uint64_t is_present = mask_of_nonzero(present_flags), is_resting = mask_of_nonzero(resting_flags),
                        is_in_set = mask_of_nonzero(set_flags);
    const std::uint64_t moves = is_present & ~(is_in_set & is_resting);
    moving = append_bits(moves, first, moving);
    leaving = append_bits(is_in_set & ~is_resting, first, leaving);
    pending += static_cast<std::size_t>(std::popcount(moves & is_resting));
  };
  const std::size_t n = present.size();
  std::size_t i = 0;
  for (; i + 64 <= n; i += 64)
    block(present.data() + i, resting.data() + i, in_resting_set + i, static_cast<std::uint32_t>(i));
  if (i < n) {
    std::uint8_t tail[3][64] = {};
    std::memcpy(tail[0], present.data() + i, n - i);
    std::memcpy(tail[1], resting.data() + i, n - i);
    std::memcpy(tail[2], in_resting_set + i, n - i);
    block(tail[0], tail[1], tail[2], static_cast<std::uint32_t>(i));
  }
  return {static_cast<std::size_t>(moving - first_moving), static_cast<std::size_t>(leaving - first_leaving), pending};
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
