#pragma once

#include <bit>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>

#include "geometry/ellipsoid.hpp"

namespace ringfence::test {

/// An ellipsoid whose support function fails for about one direction in `one_in`, always in the same way for the same
/// direction. It never fails along an axis, so that it can be registered.
///
/// `ways`, 1 to 5, is the number of ways in which it fails, taken from the start of this list: it throws a
/// std::exception, throws a number, returns NaN, returns an infinite coordinate, or returns a point far outside. Any
/// thread may call it.
class GappedEllipsoid final : public SupportFunction {
 public:
  GappedEllipsoid(Vec3f radii, std::uint64_t one_in, std::uint64_t ways = 1)
      : whole_(radii), one_in_(one_in), ways_(ways) {}

  Vec3f support(Vec3f d) const override {
    std::uint64_t h = 0;
    for (const float c : {d.x, d.y, d.z}) {
      h = (h ^ std::bit_cast<std::uint32_t>(c)) * 0xbf58476d1ce4e5b9u;
      h ^= h >> 31;
    }
    const int axes = (d.x != 0 ? 1 : 0) + (d.y != 0 ? 1 : 0) + (d.z != 0 ? 1 : 0);
    return axes < 2 || h % one_in_ != 0 ? whole_.support(d) : fail(h / one_in_ % ways_, d);
  }

 private:
  static Vec3f fail(std::uint64_t way, Vec3f d) {
    switch (way) {
      case 0:
        throw std::runtime_error("no point in this direction");
      case 1:
        throw 7;
      case 2:
        return {std::numeric_limits<float>::quiet_NaN(), 0, 0};
      case 3:
        return {0, -std::numeric_limits<float>::infinity(), 0};
      default:
        return {d.x * 1e38f, d.y * 1e38f, d.z * 1e38f};
    }
  }

  Ellipsoid whole_;
  std::uint64_t one_in_, ways_;
};

/// A GappedEllipsoid that throws for one direction in 300: many of its pairs have a contact, and the tests of many
/// others fail.
inline std::shared_ptr<const SupportFunction> gapped_ellipsoid() {
  return std::make_shared<GappedEllipsoid>(Vec3f{0.6f, 0.7f, 0.9f}, 300);
}

}  // namespace ringfence::test
