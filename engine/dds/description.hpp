#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "base/numbers.hpp"
#include "dds/wire.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::dds {

/// Parameters of a World that its nodes need besides shapes and regions. Sent as the bytes of TermsSample.
struct WorldTermsRecord {
  double bounds_min[3] = {};  ///< metres
  double bounds_max[3] = {};
  double lease_ms = 0;
  double sense = 0;                  ///< WorldConfig::sense, metres
  std::uint64_t setup_bytes = 0;     ///< size of ClusterConfig::setup; if not 0, the setup follows as a piece
  std::uint32_t cells_log2[3] = {};  ///< as in regions::CellGrid
  std::uint32_t placement = 0;       ///< value of Placement
  std::uint32_t layer_masks[32] = {};
  std::uint32_t state_bytes = 0;    ///< size of the motion model's state of one object
  std::uint32_t has_model = 0;      ///< 1: the World has a motion model
  std::uint32_t keep_resting = 0;   ///< 1: WorldConfig::keep_resting is set
  std::uint32_t remember_axes = 0;  ///< 1: WorldConfig::remember_axes is set
  std::uint32_t hosts = 0;          ///< 1: its nodes host objects (user/collision deployment)
  std::uint32_t max_objects = 0;    ///< Limits::objects
};
static_assert(sizeof(WorldTermsRecord) == 240 && std::is_trivially_copyable_v<WorldTermsRecord>);

// The unpack functions do not trust their input. They throw Error, with what was found, if a World of this release
// cannot have sent the bytes. They allocate at most a small multiple of the size of the input. Any thread may call the
// functions of this file.

/// Decodes the bytes of TermsSample.
WorldTermsRecord unpack_terms(std::span<const std::byte> bytes);
/// The grid of the World's region map.
inline regions::CellGrid grid_of(const WorldTermsRecord& terms) noexcept {
  return {{terms.cells_log2[0], terms.cells_log2[1], terms.cells_log2[2]}};
}
/// A Parcel of kind `assign`.
struct Assignment {
  AssignmentRecord record;
  std::vector<PeerRecord> peers;  ///< by slot
};
/// Serialises an assignment.
std::vector<std::byte> pack_assignment(const AssignmentRecord& record, std::span<const PeerRecord> peers);
/// Decodes the bytes of a Parcel of kind `assign`.
Assignment unpack_assignment(std::span<const std::byte> bytes, const WorldTermsRecord& terms);
/// Decodes the bytes of a complete Piece of kind `regions`: the region map that `assignment` names.
regions::RegionMap unpack_regions(std::span<const std::byte> bytes, const WorldTermsRecord& terms,
                                  const AssignmentRecord& assignment);

/// Serialises a shape. Of a support shape only the kind is stored.
std::vector<std::byte> pack_shape(const ShapeDescription& shape);

/// Restores a shape from the bytes of pack_shape(). `support` returns the support function of shape number `shape`;
/// throws Error if one is needed and `support` is null or returns null. ShapeTable::add checks sizes and coordinates.
ShapeDescription unpack_shape(std::span<const std::byte> bytes, ShapeNumber shape,
                              const std::function<std::shared_ptr<const SupportFunction>(ShapeId)>& support);

}  // namespace ringfence::dds
