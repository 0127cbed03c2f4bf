#pragma once

#include <cstdint>

#include "picture/drawing.hpp"
#include "picture/palette.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"

namespace ringfence::tools {

// How the marks of a picture look, on the map and in the legend.

/// Nodes share a hue if there are more of them than hues.
constexpr std::uint8_t hue_of(NodeId node) noexcept { return static_cast<std::uint8_t>(node.number() % node_hues); }

/// Ink of the inside of an object.
constexpr Ink ink_of(Category category, std::uint8_t hue) noexcept {
  switch (category) {
    case Category::avatar:
      return {Meaning::avatar};
    case Category::active:
      return {Meaning::active, hue};
    case Category::non_active:
      return {Meaning::non_active, hue};
    case Category::fixed:
      break;
  }
  return {Meaning::fixed};
}

/// Style of an object. The edge separates objects that overlap in the picture.
constexpr Style style_of(Category category, std::uint8_t hue) noexcept {
  const Ink fill = ink_of(category, hue);
  if (category == Category::non_active) return {fill, Ink{Meaning::active, hue}, 0.9};
  if (category == Category::fixed) return {fill, Ink{Meaning::fixed_edge}, 0.9};
  return {fill, Ink{Meaning::page}, 0.7};
}

inline constexpr double contact_edge = 0.8;  ///< width in pixels
inline constexpr Style contact_style{Ink{Meaning::contact}, Ink{Meaning::page}, contact_edge};

/// A rectangle as a polygon.
inline Polygon polygon_of(const Rectangle& r, const Style& style) {
  return {{r.min, {r.max.x, r.min.y}, r.max, {r.min.x, r.max.y}}, style};
}

}  // namespace ringfence::tools
