#pragma once

#include "facade/requests/requests.hpp"
#include "facade/save/saved_world.hpp"

namespace ringfence::facade {

/// Copies the requests, moves and inputs for the next cut to `saved`, in the order of the calls.
void collect_calls(const Requests& requests, SavedWorld& saved);

/// Makes the requests, moves and inputs of `saved`. Throws Error if one cannot have been accepted.
void restore_calls(const SavedWorld& saved, Requests::Counting counting, Requests& requests);

}  // namespace ringfence::facade
