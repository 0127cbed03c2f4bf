#include "broad_phase/row_layout.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/box_worlds.hpp"

namespace ringfence::broad_phase::test {
namespace {

TEST_CASE("a planned layout satisfies the invariants of the sweep, in every world") {
  for (const BoxWorld& world : box_worlds())
    for (const std::size_t count : {1, 20, 2000}) {
      CAPTURE(world.name);
      CAPTURE(count);
      std::mt19937_64 random(21);
      const auto boxes = draw_boxes(world, count, random);
      std::vector<std::uint32_t> slots(count);
      std::iota(slots.begin(), slots.end(), 0u);
      std::array<SizeLimit, max_levels> limits;
      const std::size_t levels = plan_levels(boxes, slots, limits);
      REQUIRE(levels >= 1);
      for (const std::uint32_t extent : limits[levels - 1].extent) CHECK(extent == 0xffffffff);
      for (std::size_t level = 0; level < levels; ++level)
        for (const std::size_t stands_for : {count, count * 1000}) {
          const auto& limit = limits[level].extent;
          const RowLayout rows = plan_rows({boxes, stands_for, {limit[0], limit[1], limit[2]}}, 8);
          for (int axis = 0; axis < 3; ++axis) {
            CAPTURE(axis);
            CHECK((rows.limit[axis] >> rows.quantum[axis]) < 31);
            const std::uint32_t partitioned = rows.cell_mask[axis] == 0 ? 0 : 0xffffffff;
            CHECK(rows.partitioned[axis] == partitioned);
            if (rows.cell_mask[axis] == 0) continue;
            CHECK(std::uint64_t{rows.cell_mask[axis]} + 1 <= std::uint64_t{1} << (32 - rows.cell_shift[axis]));
            const std::uint64_t cell = std::uint64_t{1} << rows.cell_shift[axis];
            if (axis == 0) {
              CHECK(rows.cell_mask[0] + 1 >= 2 * (rows.limit[0] / cell + 2));
            } else {
              CHECK(rows.cell_mask[axis] >= 3);
              CHECK(cell >= 2 * std::uint64_t{rows.limit[axis]});
            }
          }
          CHECK(rows.cells == (rows.cell_mask[0] + 1) * (rows.cell_mask[1] + 1) * (rows.cell_mask[2] + 1));
          CHECK((std::uint64_t{rows.buckets} << rows.bucket_shift) == rows.cells);
          CHECK(rows.cells <= 64 * stands_for + 32768);
        }
    }
}

}  // namespace
}  // namespace ringfence::broad_phase::test
