#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence::bench {

/// The traffic of one stage of a frame between a server and its nodes: what 4000 objects that moved are told to nodes,
/// in all, and what 1600 contacts are told by them.
inline constexpr std::size_t records_out = 4000;
inline constexpr std::size_t record_out_bytes = 40;
inline constexpr std::size_t records_back = 1600;
inline constexpr std::size_t record_back_bytes = 32;

/// Of them, for and from each of so many nodes.
constexpr std::size_t bytes_out(std::size_t nodes) noexcept { return records_out / nodes * record_out_bytes; }
constexpr std::size_t bytes_back(std::size_t nodes) noexcept { return records_back / nodes * record_back_bytes; }

}  // namespace ringfence::bench
