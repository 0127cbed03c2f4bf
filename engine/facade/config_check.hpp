#pragma once

#include "ringfence/config.hpp"

namespace ringfence::facade {

/// Throws Error, naming the field, what was found and what is allowed, unless a World can be made of `config`.
void check(const WorldConfig& config);

}  // namespace ringfence::facade
