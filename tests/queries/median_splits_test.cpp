#include "queries/median_splits.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "queries/box_tree.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::MedianSplits;
using queries::tree_width;

std::vector<FrameObject> at_places(std::span<const Vec3d> places) {
  std::vector<FrameObject> objects(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) objects[i].pose.position = places[i];
  return objects;
}

double along(const Vec3d& place, std::size_t axis) { return axis == 0 ? place.x : axis == 1 ? place.y : place.z; }

/// Whether the rows of each node, of `each` rows or fewer, were divided at the median of its longest side.
bool is_divided(std::span<const FrameObject> objects, std::span<const std::uint32_t> rows, std::size_t each) {
  while (rows.size() <= each) {
    if (each == tree_width) return true;
    each /= tree_width;
  }
  const std::size_t half = ((rows.size() + each - 1) / each + 1) / 2 * each;
  double longest = 0, allowed = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    double lower = along(objects[rows[0]].pose.position, a), upper = lower;
    for (const std::uint32_t row : rows) {
      lower = std::min(lower, along(objects[row].pose.position, a));
      upper = std::max(upper, along(objects[row].pose.position, a));
    }
    longest = std::max(longest, upper - lower);
    allowed = std::max({allowed, std::abs(lower), std::abs(upper)});
  }
  allowed *= 0x1p-16;  // places are floats from the first object, which is within this world
  bool is_along_one = false;
  for (std::size_t a = 0; a < 3 && !is_along_one; ++a) {
    double lower = along(objects[rows[0]].pose.position, a), upper = lower, first = lower, second = 1e300;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double place = along(objects[rows[i]].pose.position, a);
      lower = std::min(lower, place);
      upper = std::max(upper, place);
      if (i < half) first = std::max(first, place);
      if (i >= half) second = std::min(second, place);
    }
    is_along_one = upper - lower >= longest - allowed && first <= second + allowed;
  }
  return is_along_one && is_divided(objects, rows.first(half), each) && is_divided(objects, rows.subspan(half), each);
}

void check(MedianSplits& splits, std::span<const Vec3d> places, std::vector<std::uint32_t> keys) {
  CAPTURE(keys.size());
  const std::vector<FrameObject> objects = at_places(places);
  std::vector<FrameObject> rows(objects.rbegin(), objects.rend());
  std::vector<std::uint32_t> row_of(objects.size());
  for (std::uint32_t key = 0; key < row_of.size(); ++key)
    row_of[key] = static_cast<std::uint32_t>(rows.size()) - 1 - key;
  std::vector<std::uint32_t> expected = keys;
  splits.sort({rows, row_of, rows.size()}, keys);
  std::size_t each = tree_width;
  while (each * tree_width < keys.size()) each *= tree_width;
  CHECK(is_divided(objects, keys, each));
  std::sort(expected.begin(), expected.end());
  std::sort(keys.begin(), keys.end());
  CHECK(keys == expected);
}

std::vector<std::uint32_t> all_of(std::size_t count) {
  std::vector<std::uint32_t> rows(count);
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

TEST_CASE("each node of the tree has the objects of a box") {
  Random random(1);
  MedianSplits splits;
  for (const std::size_t count : {0, 1, 7, 8, 9, 16, 17, 31, 32, 33, 63, 64, 65, 100, 512, 513, 1000, 5000}) {
    std::vector<Vec3d> places(count);
    for (Vec3d& place : places) place = random.in_cube(100);
    check(splits, places, all_of(count));
    for (Vec3d& place : places) place = {place.x, place.y / 1000, 5};  // nearly on a line
    check(splits, places, all_of(count));
    for (Vec3d& place : places) place.x = place.x < 0 ? -100 : place.x * place.x * place.x / 1e4;  // many at one place
    check(splits, places, all_of(count));
  }
}

TEST_CASE("objects at one place, far apart and in other orders are divided too") {
  Random random(2);
  MedianSplits splits;
  const std::size_t count = 700;
  check(splits, std::vector<Vec3d>(count, Vec3d{3, -4, 5}), all_of(count));
  std::vector<Vec3d> places(count);
  for (Vec3d& place : places) place = random.in_cube(1e-3);
  places[5] = {1e9, 0, 0};
  places[6] = {0, -1e9, 0};
  check(splits, places, all_of(count));
  for (Vec3d& place : places) place = random.in_cube(100);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = count; i-- > 0;) {
    if (i % 3 != 0) rows.push_back(i);  // the others have no object
  }
  check(splits, places, rows);
}

TEST_CASE("bounds are divided by their centres") {
  Random random(3);
  MedianSplits splits;
  std::vector<Vec3d> places(700);
  std::vector<queries::RowBounds> bounds(places.size());
  constexpr double steps = 0x1p23;  // for each metre
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vec3d at = places[i] = random.in_cube(100);
    const double metres[] = {at.x, at.y, at.z};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto centre = static_cast<std::uint32_t>(0x1p31 + metres[a] * steps);
      const auto half = static_cast<std::uint32_t>(random.uniform(0, 50) * steps);
      bounds[i].bounds.lower[a] = centre - half;
      bounds[i].bounds.upper[a] = centre + half;
    }
  }
  std::vector<std::uint32_t> rows = all_of(places.size());
  splits.sort(bounds, rows);
  CHECK(is_divided(at_places(places), rows, 512));
  std::sort(rows.begin(), rows.end());
  CHECK(rows == all_of(places.size()));
}

/// The halved surface of the boxes around each 16 neighbours.
template <class PlaceOf>
double surface(std::size_t count, const PlaceOf& place_of) {
  double sum = 0;
  for (std::size_t first = 0; first < count; first += 16) {
    Vec3d lower = place_of(first), upper = lower;
    for (std::size_t i = first; i < std::min(first + 16, count); ++i) {
      const Vec3d p = place_of(i);
      lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
      upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
    }
    const Vec3d side = upper - lower;
    sum += side.x * side.y + side.y * side.z + side.z * side.x;
  }
  return sum;
}

TEST_CASE("states are divided as well as objects, also if they are so many that they are divided in parts") {
  Random random(4);
  MedianSplits splits;
  for (const std::size_t count : {1000, 70'000, 200'000}) {
    CAPTURE(count);
    std::vector<Vec3d> places(count);
    std::vector<SeenState> states(count);
    for (std::size_t i = 0; i < count; ++i) states[i].pose.position = places[i] = random.in_cube(100);
    std::vector<std::uint32_t> numbers = all_of(count), keys = numbers;
    splits.sort(states, numbers);
    const std::vector<FrameObject> objects = at_places(places);
    const std::vector<std::uint32_t> row_of = keys;
    splits.sort({objects, row_of, count}, keys);
    const double of_states = surface(count, [&](std::size_t i) { return places[numbers[i]]; });
    CHECK(of_states < 1.02 * surface(
                                 count, [&](std::size_t i) { return places[keys[i]]; }));
    std::sort(numbers.begin(), numbers.end());
    CHECK(numbers == all_of(count));
  }
}

}  // namespace
}  // namespace ringfence::queries_test
