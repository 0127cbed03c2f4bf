#pragma once

#include <cstdint>
#include <span>

#include "geometry/bounds.hpp"
#include "geometry/shape_view.hpp"
#include "queries/frame_object.hpp"

namespace ringfence::queries {

/// A space for the bounds of the objects `rows[objects[i]]`, as small as they allow. If some objects are very far from
/// nearly all others, they are outside, so that its steps are small where the others are; bounds saturate there.
geometry::FixedSpace choose_space(std::span<const FrameObject> rows, std::span<const std::uint32_t> objects,
                                  const geometry::ShapeRow* shapes);

}  // namespace ringfence::queries
