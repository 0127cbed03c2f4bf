#include "queries/touched_boxes.hpp"

#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::BoxTree;
using queries::TreeBox;

/// Boxes around places that follow a random path, so that neighbours in the order are near each other.
std::vector<TreeBox> random_boxes(std::size_t count, Random& random) {
  std::vector<TreeBox> boxes;
  Vec3d at{0, 0, 0};
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d step = random.in_cube(2);
    at = random.below(20) == 0 ? random.in_cube(20) : Vec3d{at.x + step.x, at.y + step.y, at.z + step.z};
    const double lower[3] = {at.x, at.y, at.z};
    TreeBox box;
    for (int a = 0; a < 3; ++a) {
      box.lower[a] = static_cast<float>(lower[a]);
      box.upper[a] = static_cast<float>(lower[a] + random.uniform(0, 2));
    }
    boxes.push_back(box);
  }
  return boxes;
}

BoxTree tree_of(const std::vector<TreeBox>& boxes) {
  BoxTree tree;
  queries::BoxGroup* const groups = tree.start(boxes.size(), {0, 0, 0});
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      groups[i / 8].lower[a][i % 8] = boxes[i].lower[a];
      groups[i / 8].upper[a][i % 8] = boxes[i].upper[a];
    }
  }
  tree.finish();
  return tree;
}

bool touch(const TreeBox& p, const TreeBox& q) {
  for (int a = 0; a < 3; ++a) {
    if (p.lower[a] > q.upper[a] || q.lower[a] > p.upper[a]) return false;
  }
  return true;
}

TEST_CASE("exactly the boxes that touch a box are listed, in their order, as the longest ranges") {
  const std::uint64_t seed = 20264;
  CAPTURE(seed);
  test::on_every_target([&] {
    Random random(seed);
    queries::TouchedBoxes touched;
    for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 63u, 64u, 65u, 511u, 513u, 3000u}) {
      CAPTURE(count);
      const std::vector<TreeBox> boxes = random_boxes(count, random);
      const BoxTree tree = tree_of(boxes);
      for (int round = 0; round < 60; ++round) {
        const Vec3d at = random.in_cube(22);
        // A reader may ask for everything: then sides are infinite, as those of unused lanes are.
        const double size = round == 1 ? 1e300 : round % 4 == 0 ? 40 : random.uniform(0, 8);
        const Vec3d low = round == 1 ? Vec3d{-size, -size, -size} : at;
        const TreeBox box = tree.box_of(low, {at.x + size, at.y + size, at.z + size});
        std::vector<std::uint32_t> expected, found;
        for (std::uint32_t i = 0; i < count; ++i) {
          if (touch(boxes[i], box)) expected.push_back(i);
        }
        const std::size_t ranges = touched.find(tree, box);
        for (std::size_t i = 0; i < ranges; ++i) {
          REQUIRE(touched[i].first < touched[i].end);
          REQUIRE((i == 0 || touched[i - 1].end < touched[i].first));
          for (std::uint32_t j = touched[i].first; j < touched[i].end; ++j) found.push_back(j);
        }
        REQUIRE(found == expected);
      }
    }
  });
}

TEST_CASE("the tree's boxes contain what they were set to, however far from the origin") {
  Random random(3);
  for (int i = 0; i < 10'000; ++i) {
    const double metres = random.uniform(-1, 1) * std::pow(10, random.uniform(-3, 9));
    REQUIRE(double{BoxTree::lower_side(metres)} <= metres);
    REQUIRE(double{BoxTree::upper_side(metres)} >= metres);
  }
}

}  // namespace
}  // namespace ringfence::queries_test
