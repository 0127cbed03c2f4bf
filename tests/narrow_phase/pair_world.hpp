#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "geometry/shape_table.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "reference/shapes.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::narrow_phase_test {

/// Pairs of objects that are close to each other, as input of the narrow phase and of the reference. `table` and
/// `reference` have the same shapes under the same numbers.
struct PairWorld {
  std::unique_ptr<geometry::ShapeTable> table = std::make_unique<geometry::ShapeTable>();
  reference::Shapes reference;
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;

  /// Adds a shape and a body with it. Returns the index of the body.
  std::uint32_t add(const ShapeDescription& shape, const Pose& pose) {
    const ShapeNumber number = table->add(shape);
    reference.add(shape);
    bodies.push_back({pose, number, static_cast<ObjectNumber>(bodies.size() + 1)});
    return static_cast<std::uint32_t>(bodies.size() - 1);
  }

  void add_pair(const ShapeDescription& a, const Pose& pose_a, const ShapeDescription& b, const Pose& pose_b) {
    const std::uint32_t first = add(a, pose_a);
    pairs.push_back({first, add(b, pose_b)});
  }

  const geometry::ShapeTable& shapes() const { return *table; }

  /// The same pairs with a and b swapped.
  std::vector<geometry::CandidatePair> swapped() const {
    std::vector<geometry::CandidatePair> out;
    for (const geometry::CandidatePair& pair : pairs) out.push_back({pair.b, pair.a});
    return out;
  }
};

/// Random shapes and poses: ordinary ones, and those that are hard for kernels.
///
/// Call at most one function per full expression, or call within braces: otherwise the compiler chooses the order of
/// the calls, and a pair that was found with one compiler cannot be reproduced with another. Lengths are in metres.
class RandomSource {
 public:
  explicit RandomSource(std::uint64_t seed) : random_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  /// Uniform in the logarithm. Precondition: 0 < low <= high.
  double logarithmic(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  /// 0 to n - 1.
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }
  /// A unit vector.
  Vec3d direction() {
    for (;;) {
      const Vec3d v{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      const double length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
      if (length > 0.1 && length < 1) return {v.x / length, v.y / length, v.z / length};
    }
  }

  /// A vector in a random direction, with a length from `low` to `high`.
  Vec3d vector(double low, double high) {
    const double length = uniform(low, high);
    return vector(length);
  }
  Vec3d vector(double length) {
    const Vec3d d = direction();
    return {d.x * length, d.y * length, d.z * length};
  }

  Quat orientation() {
    const Vec3d axis = direction();
    return about(axis, uniform(-3.15, 3.15));
  }

  static Quat about(const Vec3d& axis, double angle) {
    const double s = std::sin(angle / 2);
    return unit(axis.x * s, axis.y * s, axis.z * s, std::cos(angle / 2));
  }

  static Quat unit(double x, double y, double z, double w) {
    const double length = std::sqrt(x * x + y * y + z * z + w * w);
    return {static_cast<float>(x / length), static_cast<float>(y / length), static_cast<float>(z / length),
            static_cast<float>(w / length)};
  }

  /// A sphere, box, capsule or hull (for any other kind) of ordinary size: lengths are within about a factor of ten.
  ShapeDescription ordinary(ShapeKind kind) {
    if (kind == ShapeKind::sphere) return Sphere{size(0.3, 1.5)};
    if (kind == ShapeKind::box) return Box{{size(0.2, 1.2), size(0.2, 1.2), size(0.2, 1.2)}};
    if (kind == ShapeKind::capsule) return Capsule{size(0.2, 0.8), size(0.1, 1.5)};
    ConvexHull hull;
    const Vec3f scale{size(0.3, 1.2), size(0.3, 1.2), size(0.3, 1.2)};
    for (int points = 4 + below(40); points > 0; --points) {
      const Vec3d p = direction();
      hull.points.push_back(
          {static_cast<float>(p.x) * scale.x, static_cast<float>(p.y) * scale.y, static_cast<float>(p.z) * scale.z});
    }
    return hull;
  }

  /// A sphere, box or capsule (for any other kind) with lengths of about 1 mm to 1 km. Some are plates,
  /// needles or rods, and some have equal lengths.
  ShapeDescription degenerate(ShapeKind kind) {
    const double scale = logarithmic(0.03, 30);
    const auto length = [&] { return static_cast<float>(scale * (below(3) == 0 ? 1.0 : logarithmic(0.033, 33))); };
    if (kind == ShapeKind::sphere) return Sphere{length()};
    if (kind == ShapeKind::box) {
      Box box{{length(), length(), length()}};
      // A plate of one millimetre: the shape table accepts nothing thinner.
      if (below(4) == 0) box.half_extents.z = 0.0005f;
      if (below(4) == 0) box.half_extents.y = box.half_extents.x;
      return box;
    }
    return Capsule{length(), below(6) == 0 ? 0.0f : length()};
  }

  /// An orientation that is special relative to `other`: equal or rotated by 90 degrees, and in most cases then tilted
  /// by 10^-8 to 10^-2 rad.
  Quat special_orientation(const Quat& other) {
    const double h = std::sqrt(0.5);
    static constexpr double tilts[] = {0, 0, 0, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2};
    const double quarters[4][4] = {{0, 0, 0, 1}, {h, 0, 0, h}, {0, h, 0, h}, {0, 0, h, h}};
    const double* q = quarters[below(4)];
    const double angle = tilts[below(10)];
    const Quat tilt = about(direction(), angle);
    const std::array<double, 4> turned = product({other.x, other.y, other.z, other.w}, {q[0], q[1], q[2], q[3]});
    const std::array<double, 4> out = product({tilt.x, tilt.y, tilt.z, tilt.w}, turned);
    return unit(out[0], out[1], out[2], out[3]);
  }

 private:
  float size(double low, double high) { return static_cast<float>(uniform(low, high)); }

  static std::array<double, 4> product(const std::array<double, 4>& p, const std::array<double, 4>& q) {
    return {
        p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1], p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0],
        p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3], p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]};
  }

  std::mt19937_64 random_;
};

/// `count` pairs of two kinds, a of kind `p`, about half in contact. a is within 100 m of `origin` (metres). The result
/// depends only on the arguments.
PairWorld ordinary_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed, const Vec3d& origin = {});

/// The same with hard cases, a at `origin`: equal centres, nested, touching within rounding, parallel, crossing,
/// plates of one millimetre, sizes that differ by a factor of 1000. Precondition: `p` and `q` are sphere, box or
/// capsule.
PairWorld degenerate_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed, const Vec3d& origin = {});

/// The result of check_contacts().
struct CheckResult {
  std::size_t wrong = 0;     ///< number of errors
  std::size_t contacts = 0;  ///< number of checked contacts
  std::string text;          ///< describes the first errors, with the two objects of each
};
/// Compares the contacts of `pairs` with the reference. PairContact::pair is an index into `pairs`. `relative` is the
/// tolerance as a fraction of the smaller bounding radius. The text describes at most `most` wrong pairs.
CheckResult check_contacts(const PairWorld& world, std::span<const geometry::CandidatePair> pairs,
                           std::span<const narrow_phase::PairContact> contacts, double relative = 1e-4,
                           std::size_t most = 3);

}  // namespace ringfence::narrow_phase_test
