#include "link/publication.hpp"

#include <algorithm>
#include <atomic>
#include <map>
#include <random>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "link/doorbell.hpp"

namespace ringfence::link {
namespace {

PublishedState state_of(std::uint32_t number, double x) { return {number, number * 3, {{x, x + 1, x + 2}, {}}}; }

/// The expected contents of a publication, in the simplest data structure.
using Oracle = std::map<std::uint32_t, std::vector<PublishedState>>;

/// Publishes random states in the `cells` cells from `first_cell` on, and returns them.
Oracle write_random(Publication& publication, std::uint64_t frame, std::size_t cells, std::size_t states, bool sorted,
                    std::mt19937_64& random, std::size_t first_cell = 0) {
  std::vector<std::uint32_t> where(states);
  for (std::uint32_t& cell : where) cell = static_cast<std::uint32_t>(first_cell + random() % cells);
  if (sorted) std::sort(where.begin(), where.end());
  Oracle oracle;
  // One frame in three adds states by copy. The others add them by index, one by one or as a table.
  const bool by_index = frame % 3 != 0;
  const bool as_table = frame % 3 == 1;
  std::vector<PublishedState> table(2 * states);
  publication.begin(frame);
  for (std::size_t i = 0; i < states; ++i) {
    const PublishedState state = state_of(static_cast<std::uint32_t>(i + 1), static_cast<double>(random() % 1000));
    if (by_index) {
      table[2 * i] = state;
      if (!as_table) publication.add_index(where[i], static_cast<std::uint32_t>(2 * i));
    } else {
      publication.add(where[i], state);
    }
    oracle[where[i]].push_back(state);
  }
  if (as_table) {
    publication.add_table(static_cast<std::uint32_t>(table.size()),
                          [&](std::uint32_t i) { return i % 2 == 0 ? where[i / 2] : Publication::no_cell; });
  }
  if (by_index) {
    std::vector<int> calls(table.size(), 0);
    publication.publish_indexed([&](std::uint32_t i) { REQUIRE(i < table.size()); },
                                [&](std::uint32_t i) {
                                  REQUIRE(++calls[i] == 1);
                                  return table[i];
                                });
  } else {
    publication.publish();
  }
  return oracle;
}

std::vector<PublishedState> expected(const Oracle& oracle, std::uint32_t first, std::uint32_t last) {
  std::vector<PublishedState> all;
  for (auto it = oracle.lower_bound(first); it != oracle.end() && it->first <= last; ++it) {
    all.insert(all.end(), it->second.begin(), it->second.end());
  }
  return all;
}

/// All cells in one row, or short rows and layers.
CellLayout any_layout(std::mt19937_64& random) {
  if (random() % 3 == 0) return {};
  return {static_cast<unsigned>(random() % 7), static_cast<unsigned>(random() % 7)};
}

bool same(std::span<const PublishedState> a, const std::vector<PublishedState>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

TEST_CASE("a publication returns for each cell and each range of cells what was added, in order") {
  const std::uint64_t seed = 20261;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  struct Size {
    std::size_t cells, states;
  };
  // Few and many states in a cell, so that every method of grouping is used.
  for (const Size size :
       {Size{1, 5}, Size{10, 0}, Size{1000, 7}, Size{100000, 40}, Size{100000, 3000}, Size{64, 900}}) {
    for (const int variant : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}) {
      CAPTURE(size.cells);
      CAPTURE(size.states);
      CAPTURE(variant);
      const bool sorted = variant % 2 == 1;
      const auto frame = static_cast<std::uint64_t>(6 + variant % 3);
      Publication publication(size.cells, size.states, any_layout(random));
      const Oracle oracle = write_random(publication, frame, size.cells, size.states, sorted, random);
      std::vector<std::uint32_t> cells;
      for (const auto& [cell, states] : oracle) cells.push_back(cell);
      const auto published_cells = publication.cells(frame);
      CHECK(std::equal(published_cells.begin(), published_cells.end(), cells.begin(), cells.end()));
      CHECK(same(publication.states(frame), expected(oracle, 0, static_cast<std::uint32_t>(size.cells))));
      for (int i = 0; i < 100; ++i) {
        std::uint32_t first = static_cast<std::uint32_t>(random() % size.cells);
        std::uint32_t last = static_cast<std::uint32_t>(random() % size.cells);
        if (first > last) std::swap(first, last);
        CHECK(same(publication.read(frame, first, last), expected(oracle, first, last)));
        CHECK(same(publication.read(frame, first), expected(oracle, first, first)));
      }
      for (const std::uint32_t cell : cells) CHECK(same(publication.read(frame, cell), expected(oracle, cell, cell)));
      CHECK(publication.is_intact(frame));
    }
  }
}

TEST_CASE("if only a part of the cells has states, reading any range of cells returns those in the range") {
  const std::uint64_t seed = 20262;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  for (int round = 0; round < 60; ++round) {
    CAPTURE(round);
    const std::size_t cells = 1 + random() % 3000;
    const std::size_t part = 1 + random() % cells;
    const std::size_t first_cell = random() % (cells - part + 1);
    const CellLayout layout = any_layout(random);
    Publication publication(cells, 8, layout);
    const std::size_t count = 1 + random() % 900;
    const Oracle oracle = write_random(publication, 4, part, count, round % 3 == 0, random, first_cell);
    CellRange cell_range{{~0u, ~0u, ~0u}, {0, 0, 0}};
    for (const auto& [cell, in_cell] : oracle) {
      const std::uint32_t a_row = 1u << layout.row_log2;
      const std::uint32_t a_layer = 1u << layout.layer_log2;
      const std::uint32_t at[3] = {cell % a_row, cell / a_row % a_layer, cell / a_row / a_layer};
      for (int axis = 0; axis < 3; ++axis) {
        cell_range.lower[axis] = std::min(cell_range.lower[axis], at[axis]);
        cell_range.upper[axis] = std::max(cell_range.upper[axis], at[axis]);
      }
    }
    const CellRange published_range = publication.cell_range(4);
    REQUIRE(std::equal(cell_range.lower, cell_range.lower + 3, published_range.lower));
    REQUIRE(std::equal(cell_range.upper, cell_range.upper + 3, published_range.upper));
    const auto any_cell = [&] { return static_cast<std::uint32_t>(random() % cells); };
    std::vector<std::pair<std::uint32_t, std::uint32_t>> runs{{0u, static_cast<std::uint32_t>(cells - 1)}};
    for (int i = 0; i < 60; ++i) {
      const auto [first, last] = std::minmax({any_cell(), any_cell()});
      runs.emplace_back(first, last);
    }
    std::vector<PublishedState> all, from_rows;
    for (const auto& [first, last] : runs) {
      const auto some = expected(oracle, first, last);
      REQUIRE(same(publication.read(4, first, last), some));
      all.insert(all.end(), some.begin(), some.end());
    }
    publication.read_rows(
        4, runs.size(), [&](std::size_t i) { return runs[i]; },
        [&](std::span<const PublishedState> states) {
          REQUIRE(!states.empty());
          from_rows.insert(from_rows.end(), states.begin(), states.end());
        });
    REQUIRE(same(from_rows, all));
  }
}

TEST_CASE("a frame that is published again has its new contents, and the frame before is unchanged") {
  Publication publication(100, 4);
  std::mt19937_64 random(11);
  const Oracle before = write_random(publication, 7, 100, 30, false, random);
  write_random(publication, 8, 100, 50, false, random);
  const Oracle anew = write_random(publication, 8, 100, 40, false, random);
  CHECK(same(publication.states(8), expected(anew, 0, 99)));
  CHECK(same(publication.states(7), expected(before, 0, 99)));
  const Oracle after = write_random(publication, 9, 100, 20, false, random);
  CHECK(same(publication.states(8), expected(anew, 0, 99)));
  CHECK(same(publication.states(9), expected(after, 0, 99)));
}

TEST_CASE("only the last two frames can be read, and a reader that was overtaken detects it") {
  Publication publication(100, 4);
  std::mt19937_64 random(7);
  CHECK_FALSE(publication.published(0));
  const Oracle third = write_random(publication, 3, 100, 20, false, random);
  const Oracle fourth = write_random(publication, 4, 100, 20, false, random);
  CHECK(same(publication.states(3), expected(third, 0, 99)));
  CHECK(same(publication.states(4), expected(fourth, 0, 99)));
  CHECK(publication.is_intact(3));
  publication.begin(5);
  CHECK_FALSE(publication.is_intact(3));
  CHECK(publication.states(3).empty());
  CHECK_FALSE(publication.published(5));
  CHECK(same(publication.states(4), expected(fourth, 0, 99)));
  publication.publish();
  CHECK(publication.published(5));
  CHECK(publication.states(5).empty());
  CHECK(publication.cells(5).empty());
}

TEST_CASE("a publication that keeps one frame returns that frame, and a reader of the frame before detects it") {
  std::mt19937_64 random(8);
  for (const std::size_t cells : {std::size_t{20}, std::size_t{100000}}) {
    CAPTURE(cells);
    const auto last = static_cast<std::uint32_t>(cells - 1);
    Publication publication(cells, 4, {}, 1);
    for (std::uint64_t frame = 3; frame < 12; ++frame) {
      CAPTURE(frame);
      const Oracle oracle = write_random(publication, frame, cells, 40, frame % 2 == 0, random);
      CHECK(same(publication.states(frame), expected(oracle, 0, last)));
      CHECK_FALSE(publication.published(frame - 1));
      const Oracle anew = write_random(publication, frame, cells, 30, frame % 2 != 0, random);
      CHECK(same(publication.states(frame), expected(anew, 0, last)));
      publication.begin(frame + 1);
      CHECK_FALSE(publication.is_intact(frame));
    }
  }
}

TEST_CASE("readers in lock-step with a writer see every frame whole") {
  constexpr std::uint64_t frames = 2000;
  constexpr std::size_t readers = 3, cells = 500, states = 60;
  Publication publication(cells, 1);
  std::atomic<std::uint64_t> written{0}, wrong{0};
  std::array<std::atomic<std::uint64_t>, readers> done{};
  std::array<Doorbell, readers + 1> bells;
  std::vector<std::thread> threads;
  for (std::size_t reader = 0; reader < readers; ++reader) {
    threads.emplace_back([&, reader] {
      for (std::uint64_t frame = 1; frame <= frames; ++frame) {
        bells[reader].wait([&] { return written.load(std::memory_order_acquire) >= frame; });
        std::uint64_t sum = 0, count = 0;
        for (const std::uint32_t cell : publication.cells(frame)) {
          for (const PublishedState& state : publication.read(frame, cell)) {
            sum += state.flags;
            count += state.pose.position.x == static_cast<double>(frame) && state.number % cells == cell;
          }
        }
        if (count != states || sum != states * frame || !publication.is_intact(frame)) wrong.fetch_add(1);
        done[reader].store(frame, std::memory_order_release);
        bells[readers].ring();
      }
    });
  }
  for (std::uint64_t frame = 1; frame <= frames; ++frame) {
    publication.begin(frame);
    for (std::uint32_t i = 0; i < states; ++i) {
      const std::uint32_t number = static_cast<std::uint32_t>((i + 1) * 7919 + frame);
      publication.add(number % cells, {number, static_cast<std::uint32_t>(frame), {{static_cast<double>(frame)}, {}}});
    }
    publication.publish();
    // The writer may be at most one frame ahead of its readers.
    bells[readers].wait([&] {
      return std::all_of(done.begin(), done.end(),
                         [&](const auto& d) { return d.load(std::memory_order_acquire) + 1 >= frame; });
    });
    written.store(frame, std::memory_order_release);
    for (std::size_t reader = 0; reader < readers; ++reader) bells[reader].ring();
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong.load() == 0);
}

}  // namespace
}  // namespace ringfence::link
