// The reference for queries finds wrong answers, and accepts right ones.
#include "reference/query_check.hpp"

#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include "reference/random_shapes.hpp"
#include "reference/surface_crossing.hpp"

namespace ringfence::reference_test {
namespace {

using reference::ClaimedHit;
using reference::ClaimedPoint;
using reference::Motion;
using reference::point_shape;
using reference::PreparedShape;
using reference::Shapes;

constexpr double allowed = 1e-6;

Shapes shapes_of(const ShapeDescription& shape) { return Shapes({&shape, 1}); }

TriangleMesh square() { return {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3}}; }

std::string error_of(const PreparedShape& shape, const Motion& motion, const ClaimedHit* claimed) {
  return describe_hit_error(shape, {}, motion, claimed, allowed);
}

TEST_CASE("a ray at a box, a ball and a mesh has only one right hit") {
  for (const ShapeDescription& shape :
       {ShapeDescription(Box{{1, 1, 1}}), ShapeDescription(Sphere{1}), ShapeDescription(square())}) {
    CAPTURE(shape.index());
    const double top = shape.index() == 4 ? 0 : 1;
    const Shapes shapes = shapes_of(shape);
    const Motion ray{point_shape(), {{0.1, 0, 4}, {}}, {0, 0, -8}};
    // The ball is lower at 0.1.
    const double z = shape.index() == 0 ? std::sqrt(0.99) : top;
    const Vec3d normal = shape.index() == 0 ? Vec3d{0.1, 0, z} : Vec3d{0, 0, 1};
    const ClaimedHit right{(4 - z) / 8, normal, {0.1, 0, z}};
    CHECK(error_of(shapes[0], ray, &right) == "");
    CHECK(error_of(shapes[0], ray, nullptr) != "");
    ClaimedHit wrong = right;
    wrong.fraction += 1e-6;
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    wrong.fraction = right.fraction - 1e-6;
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    wrong = right, wrong.point.y += 1e-5;
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    wrong = right, wrong.normal = {0, 0, -1};
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    wrong = right, wrong.normal = {0.6, 0, 0.8};
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    wrong = right, wrong.normal = {0, 0, 0.999};
    CHECK(error_of(shapes[0], ray, &wrong) != "");
    const Motion short_ray{point_shape(), ray.start, {0, 0, -2.9}};
    CHECK(error_of(shapes[0], short_ray, nullptr) == "");
    CHECK(error_of(shapes[0], short_ray, &right) != "");
  }
}

TEST_CASE("a grazing ray may hit or miss within the tolerance, and not outside it") {
  const Shapes shapes = shapes_of(Sphere{1});
  const auto at_height = [&](double z, bool is_hit) {
    const Motion ray{point_shape(), {{-4, 0, z}, {}}, {8, 0, 0}};
    const ClaimedHit hit{0.5, {0, 0, 1}, {0, 0, z}};
    return error_of(shapes[0], ray, is_hit ? &hit : nullptr);
  };
  CHECK(at_height(1 + 5e-7, true) == "");
  CHECK(at_height(1 + 5e-7, false) == "");
  CHECK(at_height(1 - 5e-7, true) == "");
  CHECK(at_height(1 - 5e-7, false) == "");
  CHECK(at_height(1 + 2e-6, true) != "");
  CHECK(at_height(1 - 2e-6, false) != "");
}

TEST_CASE("a ray that crosses a mesh at an inner edge is not allowed to miss, at its rim it is") {
  const Shapes shapes = shapes_of(square());
  const auto missed = [&](double x, double y) {
    return error_of(shapes[0], {point_shape(), {{x, y, 4}, {}}, {0, 0, -8}}, nullptr);
  };
  CHECK(missed(0.5, 0.5) != "");
  CHECK(missed(0, 0) != "");
  CHECK(missed(1, 0) == "");
  CHECK(missed(1 - 2e-6, 0) != "");
}

TEST_CASE("a start inside is a hit at fraction 0 with the normal against the motion") {
  const Shapes shapes = shapes_of(Box{{1, 1, 1}});
  const Motion ray{point_shape(), {{0.5, 0, 0}, {}}, {0, 3, 0}};
  const ClaimedHit right{0, {0, -1, 0}, {0.5, 0, 0}}, turned{0, {0, 1, 0}, {0.5, 0, 0}},
      late{1.0 / 3, {0, 1, 0}, {0.5, 1, 0}};
  CHECK(error_of(shapes[0], ray, &right) == "");
  CHECK(error_of(shapes[0], ray, &turned) != "");
  CHECK(error_of(shapes[0], ray, &late) != "");
  CHECK(error_of(shapes[0], ray, nullptr) != "");
  const Motion still{point_shape(), ray.start, {}};
  const ClaimedHit of_still{0, {}, {0.5, 0, 0}};
  CHECK(error_of(shapes[0], still, &of_still) == "");
  CHECK(error_of(shapes[0], still, nullptr) != "");
}

TEST_CASE("a sweep has only one right contact") {
  Shapes shapes = shapes_of(Box{{1, 1, 1}});
  shapes.add(Box{{0.5f, 0.5f, 0.5f}});
  const Motion motion{shapes[1], {{3.5, 0.2, 0}, {}}, {-8, 0, 0}};
  const ClaimedHit right{0.25, {1, 0, 0}, {1, 0.3, -0.4}};
  CHECK(error_of(shapes[0], motion, &right) == "");
  CHECK(error_of(shapes[0], motion, nullptr) != "");
  ClaimedHit wrong = right;
  wrong.point.y = -0.4;
  CHECK(error_of(shapes[0], motion, &wrong) != "");
  wrong = right, wrong.fraction = 0.2501;
  CHECK(error_of(shapes[0], motion, &wrong) != "");
}

TEST_CASE("overlaps and nearest points are checked to the tolerance") {
  const Shapes box = shapes_of(Box{{1, 1, 1}}), ball = shapes_of(Sphere{1});
  const auto overlap = [&](double x, bool claimed) {
    return describe_overlap_error(box[0], {}, ball[0], {{x, 0, 0}, {}}, claimed, allowed);
  };
  CHECK(overlap(2.001, false) == "");
  CHECK(overlap(2.001, true) != "");
  CHECK(overlap(1.999, true) == "");
  CHECK(overlap(1.999, false) != "");
  const auto nearest = [&](double limit, const ClaimedPoint* claimed) {
    return describe_nearest_error(box[0], {}, {4, 0, 5}, limit, claimed, allowed);
  };
  const ClaimedPoint right{5, {1, 0, 1}}, far{5.1, {1, 0, 0.9}}, off{5, {1, 0.5, 1}};
  CHECK(nearest(6, &right) == "");
  CHECK(nearest(6, &far) != "");
  CHECK(nearest(6, &off) != "");
  CHECK(nearest(6, nullptr) != "");
  CHECK(nearest(4, nullptr) == "");
  CHECK(nearest(4, &right) != "");
}

TEST_CASE("a segment crosses a surface at its corners and rims, and not in its plane") {
  const Shapes shapes = shapes_of(square());
  const auto& surface = shapes[0].surface;
  CHECK(first_crossing(surface, {1, 1, 1}, {1, 1, -1}) == 0.5);
  CHECK(first_crossing(surface, {0.25, 0.25, 3}, {0.25, 0.25, -1}) == 0.75);
  CHECK(first_crossing(surface, {1, 0, 1}, {1, 0, 0}) == 1.0);
  CHECK_FALSE(first_crossing(surface, {std::nextafter(1.0, 2.0), 0, 1}, {std::nextafter(1.0, 2.0), 0, -1}));
  CHECK_FALSE(first_crossing(surface, {-3, 0, 0}, {3, 0, 0}));
}

}  // namespace
}  // namespace ringfence::reference_test
