#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ringfence/pose.hpp"
#include "worlds/query_file.hpp"

namespace ringfence::tools {

/// The queries of a run, about each counted frame.
struct QueryLoad {
  std::vector<worlds::QueryRow> rows;  ///< of --queries, in order of (frame, query)
  std::string answers;                 ///< path of --answers; empty: no file
  std::uint32_t rays = 0;              ///< random rays of each frame (--rays)
  std::uint64_t seed = 1;              ///< of the rays
  Vec3d bounds_min, bounds_max;        ///< where the rays start

  bool is_empty() const noexcept { return rows.empty() && rays == 0 && answers.empty(); }
};

/// Length of the rays of --rays, metres.
inline constexpr double ray_length = 50;

/// Replaces `rows` by the random rays of a frame: first hits, with ids 0 to rays - 1. The same bits on every machine.
void make_rays(const QueryLoad& load, std::uint32_t frame, std::vector<worlds::QueryRow>& rows);

}  // namespace ringfence::tools
