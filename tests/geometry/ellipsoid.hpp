#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

#include "geometry/vector.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::test {

/// An ellipsoid, given by its support function: not expressible as another kind of shape.
class Ellipsoid final : public SupportFunction {
 public:
  explicit Ellipsoid(Vec3f radii) : radii_(radii) {}
  Vec3f support(Vec3f d) const override {
    const Vec3f scaled{d.x * radii_.x, d.y * radii_.y, d.z * radii_.z};
    const float norm = length(scaled);
    return {scaled.x * radii_.x / norm, scaled.y * radii_.y / norm, scaled.z * radii_.z / norm};
  }
  std::string_view name() const noexcept override { return "ellipsoid"; }
  std::uint64_t version() const noexcept override { return std::bit_cast<std::uint32_t>(radii_.x); }

 private:
  Vec3f radii_;
};

}  // namespace ringfence::test
