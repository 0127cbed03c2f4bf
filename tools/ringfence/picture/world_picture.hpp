#pragma once

#include <string>

#include "picture/drawing.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// A picture of a world after its last frame, seen from above: the regions by CD node, the enabled objects by category,
/// the contacts, a scale bar and a legend. Objects outside the world's bounds are counted in the legend, not drawn.
///
/// `contact` is what the legend calls the mark of a contact. A pure function of the world's state and region map, so
/// two runs of a world have the same picture if their maps are the same, as with BalanceBy::pairs. Precondition: no
/// frame is running.
Drawing draw_world(const World& world, const std::string& contact = "contact point");

}  // namespace ringfence::tools
