#pragma once

#include <cstddef>

#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// An object of a World that is restored from a save, as it stood after the last frame before.
struct RestoredObject {
  ObjectId id;
  ObjectSpec spec;
  const std::byte* state = nullptr;  ///< the motion model's
};

}  // namespace ringfence::nodes
