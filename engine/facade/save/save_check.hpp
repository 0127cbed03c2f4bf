#pragma once

#include "facade/save/saved_world.hpp"

namespace ringfence::facade {

/// Throws Error unless the records fit together; see read_save().
void check(const SavedWorld& saved);

/// The same for its requests, moves and inputs alone.
void check_calls(const SavedWorld& saved);

}  // namespace ringfence::facade
