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

/// What a publication should say, kept as slowly and plainly as can be.
using Oracle = std::map<std::uint32_t, std::vector<PublishedState>>;

/// States of the `cells` cells from `first_cell` on.
Oracle write_random(Publication& publication, std::uint64_t frame, std::size_t cells, std::size_t states, bool sorted,
                    std::mt19937_64& random, std::size_t first_cell = 0) {
  std::vector<std::uint32_t> where(states);
  for (std::uint32_t& cell : where) cell = static_cast<std::uint32_t>(first_cell + random() % cells);
  if (sorted) std::sort(where.begin(), where.end());
  Oracle oracle;
  // Of every three frames the states of one are copied in, and of the others listed, one by one or as a table, and
  // taken from a table of their own.
  const bool listed = frame % 3 != 0;
  const bool as_table = frame % 3 == 1;
  std::vector<PublishedState> table(2 * states);
  publication.begin(frame);
  for (std::size_t i = 0; i < states; ++i) {
    const PublishedState state = state_of(static_cast<std::uint32_t>(i + 1), static_cast<double>(random() % 1000));
    if (listed) {
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
  if (listed) {
    std::vector<int> asked(table.size(), 0);
    publication.publish_indexed([&](std::uint32_t i) { REQUIRE(i < table.size()); },
                                [&](std::uint32_t i) {
                                  REQUIRE(++asked[i] == 1);
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

/// All cells in a row, or in rows and layers of few.
CellLayout any_layout(std::mt19937_64& random) {
  if (random() % 3 == 0) return {};
  return {static_cast<unsigned>(random() % 7), static_cast<unsigned>(random() % 7)};
}

bool same(std::span<const PublishedState> a, const std::vector<PublishedState>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

TEST_CASE("a publication returns for each cell, and each run of cells, what was added, in order") {
  const std::uint64_t seed = 20261;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  struct Size {
    std::size_t cells, states;
  };
  // Few and many states to a cell, so that every way of grouping is used.
  for (const Size size :
       {Size{1, 5}, Size{10, 0}, Size{1000, 7}, Size{100000, 40}, Size{100000, 3000}, Size{64, 900}}) {
    for (const int way : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}) {
      CAPTURE(size.cells);
      CAPTURE(size.states);
      CAPTURE(way);
      const bool sorted = way % 2 == 1;
      const auto frame = static_cast<std::uint64_t>(6 + way % 3);
      Publication publication(size.cells, size.states, any_layout(random));
      const Oracle oracle = write_random(publication, frame, size.cells, size.states, sorted, random);
      std::vector<std::uint32_t> cells;
      for (const auto& [cell, states] : oracle) cells.push_back(cell);
      const auto listed = publication.cells(frame);
      CHECK(std::equal(listed.begin(), listed.end(), cells.begin(), cells.end()));
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

TEST_CASE("of states in a part of the cells, those of any run of cells are returned, within the part and beyond it") {
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
    const CellRange said = publication.cell_range(4);
    REQUIRE(std::equal(cell_range.lower, cell_range.lower + 3, said.lower));
    REQUIRE(std::equal(cell_range.upper, cell_range.upper + 3, said.upper));
    const auto any_cell = [&] { return static_cast<std::uint32_t>(random() % cells); };
    std::vector<std::pair<std::uint32_t, std::uint32_t>> runs{{0u, static_cast<std::uint32_t>(cells - 1)}};
    for (int i = 0; i < 60; ++i) {
      const auto [first, last] = std::minmax({any_cell(), any_cell()});
      runs.emplace_back(first, last);
    }
    std::vector<PublishedState> all, by_rows;
    for (const auto& [first, last] : runs) {
      const auto some = expected(oracle, first, last);
      REQUIRE(same(publication.read(4, first, last), some));
      all.insert(all.end(), some.begin(), some.end());
    }
    publication.read_rows(
        4, runs.size(), [&](std::size_t i) { return runs[i]; },
        [&](std::span<const PublishedState> states) {
          REQUIRE(!states.empty());
          by_rows.insert(by_rows.end(), states.begin(), states.end());
        });
    REQUIRE(same(by_rows, all));
  }
}

TEST_CASE("a frame that is published anew says what was said last, and the frame before stays") {
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

TEST_CASE("the last two frames can be read, no other, and a reader that was overtaken is told") {
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
    // The writer may be one frame ahead of its readers, no more.
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
