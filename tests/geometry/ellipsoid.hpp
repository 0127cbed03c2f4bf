#pragma once

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

 private:
  Vec3f radii_;
};

}  // namespace ringfence::test
