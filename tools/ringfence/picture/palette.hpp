#pragma once

#include <cstdint>

#include "picture/drawing.hpp"

namespace ringfence::tools {

/// Which colours a picture has.
enum class PictureColors : std::uint8_t {
  automatic,  ///< SVG: those that the reader's system prefers; PNG: light
  light,
  dark
};
/// Name in options.
constexpr const char* name_of(PictureColors colors) noexcept {
  constexpr const char* names[] = {"auto", "light", "dark"};
  return names[static_cast<std::size_t>(colors)];
}

/// A colour in sRGB.
struct Color {
  std::uint8_t red = 0, green = 0, blue = 0;
  double opacity = 1;
  bool operator==(const Color&) const = default;
};

/// Number of different colours of CD nodes.
inline constexpr std::uint8_t node_hues = 8;
/// Hue of marks that stand for the objects of any node: grey.
inline constexpr std::uint8_t neutral_hue = node_hues;

/// The colour of an ink on a light or a dark page.
///
/// The colours of the nodes differ for readers with any common colour blindness, in this order (after Okabe and Ito
/// 2008, and Tol 2021). The red of contacts is not among them, and contacts also have a shape of their own.
Color color_of(Ink ink, bool dark);

}  // namespace ringfence::tools
