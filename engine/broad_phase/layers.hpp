#pragma once

#include <array>
#include <cstdint>

namespace ringfence::broad_phase {

/// Bit j of element i: layers i and j collide. Symmetric.
using LayerMasks = std::array<std::uint32_t, 32>;

constexpr LayerMasks all_layers_collide() noexcept {
  LayerMasks masks{};
  masks.fill(~std::uint32_t{0});
  return masks;
}

/// The bit of a layer byte that marks a static object, and the bits of the layer.
inline constexpr std::uint8_t fixed_object = 0x80;
inline constexpr std::uint8_t layer_number = 0x1f;

}  // namespace ringfence::broad_phase
