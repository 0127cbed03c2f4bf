#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <span>
#include <vector>

#include "geometry/ellipsoid.hpp"
#include "geometry/shape_table.hpp"
#include "queries/frame_object.hpp"

namespace ringfence::queries_test {

using queries::FrameObject;

/// An object, with what a frame keeps beside its row.
struct TestObject : FrameObject {
  std::uint32_t group = 0, slot = 0;
  std::uint8_t jumped = 0;
};

/// Objects as a frame has them, in rows of another order than that of their keys.
class RowLists {
 public:
  /// Objects by key; one with the number 0 is not there. The rows begin with the object after `shift` others.
  explicit RowLists(std::span<const TestObject> objects, std::size_t shift = 1)
      : row_of_(objects.size(), queries::FrameRows::none) {
    add({}, 7);  // a row that does not count
    for (std::size_t i = objects.size(); i-- > 0;) {
      const std::size_t key = (i + shift) % objects.size();
      const TestObject& object = objects[key];
      if (object.number == 0) continue;
      row_of_[key] = static_cast<std::uint32_t>(rows_.size());
      add(object, object.group);
      jumped_.back() = object.jumped;
    }
  }

  queries::FrameRows view() const { return {rows_, row_of_, rows_.size() - 1, groups_, jumped_}; }
  /// `of(object)` of each row.
  template <class Value, class Of>
  std::vector<Value> each(const Of& of) const {
    std::vector<Value> values(1);
    for (std::size_t row = 1; row < rows_.size(); ++row) values.push_back(of(rows_[row]));
    return values;
  }

 private:
  void add(const FrameObject& object, std::uint32_t group) {
    rows_.push_back(object);
    groups_.push_back(group);
    jumped_.push_back(0);
  }

  std::vector<FrameObject> rows_;
  std::vector<std::uint32_t> row_of_, groups_;
  std::vector<std::uint8_t> jumped_;
};

class Random {
 public:
  explicit Random(std::uint64_t seed) : random_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }
  Vec3d in_cube(double half) {
    const double x = uniform(-half, half), y = uniform(-half, half), z = uniform(-half, half);
    return {x, y, z};
  }
  Quat orientation() {
    for (;;) {
      double q[4], squares = 0;
      for (double& v : q) v = uniform(-1, 1), squares += v * v;
      if (squares < 0.01 || squares > 1) continue;
      const double s = 1 / std::sqrt(squares);
      return {static_cast<float>(q[0] * s), static_cast<float>(q[1] * s), static_cast<float>(q[2] * s),
              static_cast<float>(q[3] * s)};
    }
  }

 private:
  std::mt19937_64 random_;
};

/// One shape of every kind; the last is a mesh, the others are convex.
inline void add_shapes(geometry::ShapeTable& table) {
  table.add(Sphere{0.7f});
  table.add(Box{{0.6f, 1.8f, 0.3f}});
  table.add(Capsule{0.4f, 1.5f});
  table.add(
      ConvexHull{{{3, 0, 0}, {1, 0.2f, 0}, {2, 1, 0.3f}, {2.1f, -1, 0}, {2, 0, 1}, {2, 0, -1}}});  // off its origin
  table.add(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{0.5f, 0.7f, 1.9f})});
  table.add(TriangleMesh{{{-2, 0, 0}, {2, 0, 0}, {0, 3, 1}, {0, -1, 2}}, {0, 1, 2, 0, 1, 3}});
}
inline constexpr ShapeNumber mesh_shape = 5, shapes = 6;

/// `count` rows around `origin`; numbers are distinct, and some rows have no object.
inline std::vector<TestObject> make_rows(Random& random, std::size_t count, double half, const Vec3d& origin) {
  std::vector<TestObject> rows(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (random.below(10) == 0) continue;
    const Vec3d at = random.in_cube(half);
    TestObject& row = rows[i];
    row.pose = {{origin.x + at.x, origin.y + at.y, origin.z + at.z}, random.orientation()};
    row.shape = static_cast<ShapeNumber>(random.below(shapes));
    row.number = static_cast<ObjectNumber>(count * 2 - i);
    row.generation = 1 + i % 3;
    row.group = i % 4;
    row.slot = i;
    row.layer = static_cast<std::uint8_t>(i % 5);
    row.category = static_cast<std::uint8_t>(i % 4);
  }
  return rows;
}

}  // namespace ringfence::queries_test
