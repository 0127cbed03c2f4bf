#pragma once

#include <cstdint>

namespace ringfence::nodes {

/// A step of a frame under a region map, in one word, so that threads store and load it as a whole. A default mark is
/// of no frame.
///
/// It holds the low 32 bits of the frame's number and the low 29 of the map's epoch. Marks that are compared are never
/// so many frames or maps apart that these repeat.
template <class Step>
class FrameMark {
 public:
  constexpr FrameMark() noexcept = default;
  constexpr FrameMark(std::uint64_t frame, std::uint32_t epoch, Step step) noexcept
      : word_(frame << 32 | std::uint64_t{epoch & epoch_mask} << step_bits | static_cast<std::uint64_t>(step)) {}

  constexpr Step step() const noexcept { return static_cast<Step>(word_ & ((1u << step_bits) - 1)); }
  constexpr bool is_of(std::uint64_t frame) const noexcept {
    return step() != Step::none && word_ >> 32 == (frame & 0xffffffffu);
  }
  constexpr bool has_epoch(std::uint32_t epoch) const noexcept {
    return (word_ >> step_bits & epoch_mask) == (epoch & epoch_mask);
  }
  constexpr bool operator==(const FrameMark&) const noexcept = default;

 private:
  static constexpr unsigned step_bits = 3;
  static constexpr std::uint32_t epoch_mask = (1u << (32 - step_bits)) - 1;

  std::uint64_t word_ = 0;
};

}  // namespace ringfence::nodes
