#pragma once

#include <cstdint>

#include "ringfence/config.hpp"

namespace ringfence::facade {

/// Largest number of CD nodes of a World.
inline constexpr std::uint32_t max_nodes = 1024;
inline constexpr std::uint32_t max_history = 4096;

/// Throws Error if `config` is invalid; the message names the field, its value and what is allowed.
void check(const WorldConfig& config);

/// Checks `config` and replaces automatic choices by their values. Throws Error as check().
WorldConfig settle(WorldConfig config);

/// The cheaper placement for this number of CD nodes (0: everything in one thread).
///
/// Measured with 1000 to 256,000 objects in user/collision deployment (docs/performance.md). With one node, the
/// server's sweep overlaps with the node's tests, which outweighs its cost. From two nodes on, the work that the server
/// saves (sweep, sending pairs) exceeds what the busiest node does instead, by 14 to 70 % of the sum of the two. The
/// total CPU time is lower too, so the choice also holds on few cores.
Placement choose_placement(std::uint32_t nodes) noexcept;

}  // namespace ringfence::facade
