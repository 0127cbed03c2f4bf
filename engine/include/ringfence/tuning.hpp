#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence {

/// Settings that measurements compare. No setting changes a contact, and the defaults are the fastest known, so a
/// server need not set them. WorldConfig::tuning holds them; the constructor of World checks them.
struct Tuning {
  /// Number of region cells on each axis as a base-2 logarithm, 0 to 10; all 0: the World chooses.
  std::uint32_t cells_log2[3] = {0, 0, 0};
  /// Size in bytes of every ring except those to and from remote nodes: a power of two, 4096 to 2^30. 0: the World
  /// chooses by role.
  std::size_t ring_bytes = 0;
  /// Whether the broad phase keeps objects that do not move in a separate structure.
  bool keep_resting = true;
  /// Whether CD nodes remember the axes that separated hulls in earlier frames.
  bool remember_axes = true;
};

}  // namespace ringfence
