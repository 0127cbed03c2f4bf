#pragma once

#include <cstdint>
#include <type_traits>

#include "base/numbers.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::geometry {

class CheckedSupport;
class Hull;
class Mesh;

/// The data of a shape that a kernel needs, without indirection: 32 bytes, read by gather.
struct ShapeRow {
  /// In metres. Sphere: radius, 0, 0; box: the three half extents; capsule: radius, half height, 0; hull: its centroid;
  /// others: 0.
  float size[3] = {};
  /// Of a ball around the shape's origin that contains the shape. Sphere: exactly the radius; kernels read it there.
  float bounding_radius = 0;
  ShapeKind kind = ShapeKind::sphere;
  std::uint8_t reserved[3] = {};
  std::uint32_t index_in_kind = 0;  ///< index among the hulls, meshes or support functions
  std::uint32_t reserved2[2] = {};
};
static_assert(sizeof(ShapeRow) == 32);

/// What a kernel reads of prepared shapes. A view: it owns nothing, and shares the lifetime and the threads of what it
/// refers to. Trivially copyable.
class ShapeView {
 public:
  ShapeView() noexcept = default;  ///< of no shapes
  ShapeView(const ShapeRow* rows, const Hull* const* hulls, const Mesh* const* meshes,
            const CheckedSupport* const* supports) noexcept
      : rows_(rows), hulls_(hulls), meshes_(meshes), supports_(supports) {}

  const ShapeRow* rows() const noexcept { return rows_; }  ///< by shape number
  const ShapeRow& row(ShapeNumber shape) const noexcept { return rows_[shape]; }
  const Hull& hull(std::uint32_t index_in_kind) const noexcept { return *hulls_[index_in_kind]; }
  const Mesh& mesh(std::uint32_t index_in_kind) const noexcept { return *meshes_[index_in_kind]; }
  const CheckedSupport& support(std::uint32_t index_in_kind) const noexcept { return *supports_[index_in_kind]; }

 private:
  const ShapeRow* rows_ = nullptr;
  const Hull* const* hulls_ = nullptr;
  const Mesh* const* meshes_ = nullptr;
  const CheckedSupport* const* supports_ = nullptr;
};
static_assert(std::is_trivially_copyable_v<ShapeView>);

}  // namespace ringfence::geometry
