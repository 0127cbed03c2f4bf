#pragma once

#include <memory>
#include <span>

#include "facade/save/save_stream.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::facade {

/// Writes a shape as it was registered; of a support shape the name and version of its function.
void write_shape(SaveWriter& to, const ShapeDescription& shape);

/// Reads a shape. Throws Error if its kind is unknown, or if no function has the name and version of a support shape.
/// What ShapeTable::add checks is not checked.
ShapeDescription read_shape(SaveReader& from, std::span<const std::shared_ptr<const SupportFunction>> functions);

}  // namespace ringfence::facade
