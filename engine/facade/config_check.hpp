#pragma once

#include <cstdint>

#include "ringfence/config.hpp"

namespace ringfence::facade {

/// CD nodes of a World.
inline constexpr std::uint32_t most_nodes = 1024;

/// Throws Error, naming the field, what was found and what is allowed, unless a World can be made of `config`.
void check(const WorldConfig& config);

/// Checks `config` and puts in what was left to the World to choose. Throws Error as check().
WorldConfig settle(WorldConfig config);

/// Which placement is the cheaper for so many CD nodes (0: everything in one thread).
///
/// Measured with 1000 to 256,000 objects in user/collision deployment (docs/performance.md): with one node the server
/// sweeps while it tests, which is worth as much as what that costs. From two nodes on, what the server no longer does
/// (sweeping, sending pairs) is more than what the busiest node does in its place, by 14 to 70 % of the two together,
/// and the CPU time of all threads is less as well, so that it holds on few cores too.
Placement choose_placement(std::uint32_t nodes) noexcept;

}  // namespace ringfence::facade
