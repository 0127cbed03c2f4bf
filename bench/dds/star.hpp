#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence::bench {

/// Traffic of one stage of a frame between a server and its nodes: 4000 position records to the nodes, and 1600
/// contacts back, all nodes together.
inline constexpr std::size_t records_out = 4000;
inline constexpr std::size_t record_out_bytes = 40;
inline constexpr std::size_t records_back = 1600;
inline constexpr std::size_t record_back_bytes = 32;

/// Bytes to and from each of `nodes` nodes.
constexpr std::size_t bytes_out(std::size_t nodes) noexcept { return records_out / nodes * record_out_bytes; }
constexpr std::size_t bytes_back(std::size_t nodes) noexcept { return records_back / nodes * record_back_bytes; }

}  // namespace ringfence::bench
