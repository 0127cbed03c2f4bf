#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "picture/drawing.hpp"
#include "picture/view.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

inline constexpr std::size_t category_count = 4;

/// What the map of a picture shows.
struct Shown {
  std::array<std::size_t, category_count> objects{};  ///< enabled objects by category
  std::size_t outside = 0;                            ///< of them, those outside the map
  double contact_radius = 0;                          ///< pixels
};

/// Adds what surrounds the map: heading, scale bar and legend. Sets the size and the title of the drawing.
void add_surroundings(Drawing& drawing, const World& world, const View& view, const Shown& shown,
                      const std::string& contact);

}  // namespace ringfence::tools
