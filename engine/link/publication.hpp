#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "link/atomics.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::link {

/// How cells are numbered in rows and layers: the lowest `row_log2` bits count along a row, the next `layer_log2` the
/// rows of a layer. What is published lies in a box of these as a rule. Without more said: all cells are one row.
struct CellLayout {
  unsigned row_log2 = 31;
  unsigned layer_log2 = 0;

  struct Place {
    std::uint32_t at[3];  ///< in its row, of its row in its layer, of its layer
  };
  constexpr Place place_of(std::uint32_t cell) const noexcept {
    return {{cell & ((std::uint32_t{1} << row_log2) - 1), cell >> row_log2 & ((std::uint32_t{1} << layer_log2) - 1),
             static_cast<std::uint32_t>(std::uint64_t{cell} >> (row_log2 + layer_log2))}};
  }
  constexpr std::uint32_t cell_at(const std::uint32_t at[3]) const noexcept {
    return at[0] | at[1] << row_log2 | static_cast<std::uint32_t>(std::uint64_t{at[2]} << (row_log2 + layer_log2));
  }
};

/// The least box of cells that holds all of a frame's, both corners included; as CellLayout::Place has it.
struct CellRange {
  std::uint32_t lower[3];
  std::uint32_t upper[3];
};

/// One state that is told to many: where an object is. One layout here and at the API.
using PublishedState = SeenState;

/// What one tells many, once a frame: states grouped by cell, written once, read in place by any number of threads.
///
/// Two editions take turns, so that the one published last and the one before it can be read.
///
/// The contract that the frame protocol keeps: all readers of frame k are done before the writer begins frame k + 2
/// (in lock-step they are done before the server lets k + 1 end). Whoever breaks it is found out, not lied to: an
/// edition carries its frame's stamp while it is whole, `read` returns nothing without it, and a reader that is done
/// asks `intact` whether the stamp is still there; if not, what it read may be torn and is to be dropped.
///
/// Cost: by the number of states, not of cells. Adding is a copy; publishing moves nothing when the states were added
/// in ascending order of cell, else sorts (counting where there are few cells to a state, radix or comparison
/// elsewhere) and moves each state once. Reading a cell is one index where states are dense, a binary search over the
/// cells that hold something where they are sparse; of the cells only those in the least box of rows and layers that
/// holds all that hold something count, so that many writers, each of a box of them, do as well as one of all. Nothing
/// is copied and no line is written, so readers do not disturb each other.
///
/// Threads: begin, add and publish from one thread, the writer; everything const from any. Memory: reserved by the
/// constructor, grown between frames and never shrunk.
class Publication {
 public:
  /// For cells 0 to `cells` - 1, at most 2^31; reserves for `states` states a frame. More may be added, at the price of
  /// an allocation.
  Publication(std::size_t cells, std::size_t states, CellLayout layout = {});

  /// Writer: starts the edition of `frame`, which is no less than any before and less than 2^64 - 1. The edition of two
  /// frames ago is gone from here on. The same frame again is published anew, for which no reader may have begun it.
  void begin(std::uint64_t frame) noexcept;
  /// Writer: adds a state of `cell`. Any order; within a cell the order of adding is kept.
  void add(std::uint32_t cell, const PublishedState& state);
  /// Writer: groups what was added by cell and shows it, by one store.
  void publish();

  /// Writer, in place of add: a state of `cell` that is entry `index` of a table that the writer keeps.
  void add_index(std::uint32_t cell, std::uint32_t index) {
    assert(cell < cell_count_);
    if (listed_ == keys_.size()) keys_.resize(2 * listed_ + 64);
    ascending_ &= listed_ == 0 || cell_of(keys_[listed_ - 1]) <= cell;
    keys_[listed_++] = key_of(cell, index);
  }
  /// Writer: the same of a whole table of `size` entries, of which `cell_at(i)` says the cell of the i-th, or
  /// `nowhere`.
  template <class CellAt>
  void add_table(std::uint32_t size, CellAt cell_at) {
    if (keys_.size() < listed_ + size) keys_.resize(listed_ + size);
    std::uint64_t* next = keys_.data() + listed_;
    std::uint32_t last = listed_ == 0 ? 0 : cell_of(next[-1]);
    bool ascending = ascending_;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t cell = cell_at(i);
      if (cell == no_cell) continue;
      assert(cell < cell_count_);
      ascending &= last <= cell;  // no branch: it does as often as not
      last = cell;
      *next++ = key_of(cell, i);
    }
    ascending_ = ascending;
    listed_ = static_cast<std::size_t>(next - keys_.data());
  }
  static constexpr std::uint32_t no_cell = 0xffffffffu;
  /// Writer, in place of publish: the same of what was listed. `fetch(index)` is called a while before
  /// `state_of(index)`, which answers a PublishedState and is called once for each.
  template <class Fetch, class StateOf>
  void publish_indexed(Fetch prefetch, StateOf state_of) {
    constexpr std::size_t ahead = 16;  // what belongs to a cell lies anywhere
    Edition& edition = arrange();
    const std::size_t size = listed_;
    edition.states.resize(size);
    for (std::size_t i = 0; i < size; ++i) {
      if (i + ahead < size) prefetch(index_of(keys_[i + ahead]));
      edition.states[i] = state_of(index_of(keys_[i]));
    }
    show(edition);
  }

  /// Reader: whether `frame` is there to be read: it was published last, or before that.
  bool published(std::uint64_t frame) const noexcept { return find(frame) != nullptr; }
  /// Reader: the states of one cell; empty when there are none, or the frame is not there.
  std::span<const PublishedState> read(std::uint64_t frame, std::uint32_t cell) const noexcept {
    return read(frame, cell, cell);
  }
  /// Reader: the states of the cells from `first` to `last`, both included, in ascending order of cell: one row of the
  /// cells near an avatar by one look-up.
  std::span<const PublishedState> read(std::uint64_t frame, std::uint32_t first, std::uint32_t last) const noexcept {
    const Edition* edition = find(frame);
    return edition ? row(*edition, first, last) : std::span<const PublishedState>();
  }
  /// Reader: the same for many rows: calls `use(states)` for each of which cells_of(i), i from 0 to `rows` - 1, is the
  /// first and last cell, and that is not empty.
  template <class CellsOf, class Use>
  void read_rows(std::uint64_t frame, std::size_t rows, CellsOf cells_of, Use use) const {
    const Edition* edition = find(frame);
    for (std::size_t i = 0; edition && i < rows; ++i) {
      const auto [first, last] = cells_of(i);
      const auto states = row(*edition, first, last);
      if (!states.empty()) use(states);
    }
  }
  /// Reader: all states of a frame in ascending order of cell.
  std::span<const PublishedState> states(std::uint64_t frame) const noexcept;
  /// Reader: the least box of cells that holds all that hold states. Precondition: there are such.
  CellRange cell_range(std::uint64_t frame) const noexcept;
  /// Reader: the cells of a frame that hold states, ascending.
  std::span<const std::uint32_t> cells(std::uint64_t frame) const noexcept;
  /// Reader: where the states of each of those cells begin in states(); one more entry ends the last.
  std::span<const std::uint32_t> starts(std::uint64_t frame) const noexcept;
  /// Reader, after it has used what it read of `frame`: whether that was whole all the time.
  bool is_intact(std::uint64_t frame) const noexcept;

 private:
  /// The reach as a directory has it.
  struct Box {
    CellRange cell_range{};
    std::uint32_t rows = 0;  ///< of it in a layer
    std::uint32_t wide = 0;  ///< cells of it in a row

    /// Where in the directory a place within it is.
    std::size_t entry(const CellLayout::Place& place) const noexcept {
      return (std::size_t{place.at[2] - cell_range.lower[2]} * rows + (place.at[1] - cell_range.lower[1])) * wide +
             (place.at[0] - cell_range.lower[0]);
    }
  };

  /// What one frame says. `starts[i]` is where the states of `cells[i]` begin; one more entry ends the last.
  struct alignas(cache_line_pair_bytes) Edition {
    std::atomic<std::uint64_t> stamp{no_stamp};  ///< the frame, while the rest is whole
    bool dense = false;                          ///< `directory` is filled
    Box box;
    std::vector<PublishedState> states;
    std::vector<std::uint32_t> cells;
    std::vector<std::uint32_t> starts;
    std::vector<std::uint32_t> directory;  ///< by cell of the reach: how many states lie before it; one more entry
  };

  static constexpr std::uint64_t no_stamp = ~std::uint64_t{0};

  static constexpr std::uint64_t key_of(std::uint32_t cell, std::uint32_t index) noexcept {
    return std::uint64_t{cell} << 32 | index;
  }
  static constexpr std::uint32_t cell_of(std::uint64_t key) noexcept { return static_cast<std::uint32_t>(key >> 32); }
  static constexpr std::uint32_t index_of(std::uint64_t key) noexcept { return static_cast<std::uint32_t>(key); }

  const Edition* find(std::uint64_t frame) const noexcept {
    // Pairs with the store in show.
    for (const Edition& edition : editions_) {
      if (edition.stamp.load(std::memory_order_acquire) == frame) return &edition;
    }
    return nullptr;
  }
  /// How many states lie before a cell. Precondition: the edition is dense.
  std::uint32_t before(const Edition& edition, std::uint32_t cell) const noexcept {
    const CellRange& cell_range = edition.box.cell_range;
    CellLayout::Place place = layout_.place_of(cell);
    // What is before or behind the reach on an axis is so wherever it lies on those below.
    for (std::size_t axis = 3; axis-- > 0;) {
      if (place.at[axis] < cell_range.lower[axis]) {
        std::copy_n(cell_range.lower, axis + 1, place.at);
        break;
      }
      if (place.at[axis] > cell_range.upper[axis]) {
        std::copy_n(cell_range.lower, axis, place.at);
        place.at[axis] = cell_range.upper[axis] + 1;
        break;
      }
    }
    return edition.directory[edition.box.entry(place)];
  }
  std::span<const PublishedState> row(const Edition& edition, std::uint32_t first, std::uint32_t last) const noexcept {
    assert(first <= last);
    if (!edition.dense) return search(edition, first, last);
    const PublishedState* states = edition.states.data();
    return {states + before(edition, first), states + before(edition, last + 1)};
  }
  static std::span<const PublishedState> search(const Edition& edition, std::uint32_t first,
                                                std::uint32_t last) noexcept;
  Edition& arrange();
  void show(Edition& edition);
  std::size_t find_cell_range(Edition& edition) const noexcept;
  std::span<const std::uint64_t> keys() const noexcept { return {keys_.data(), listed_}; }
  void count_keys(Edition& edition, std::size_t cells);
  void sort_keys();
  void list_cells(Edition& edition);
  void list_counted(Edition& edition);

  std::array<Edition, 2> editions_;
  std::size_t cell_count_;
  CellLayout layout_;

  // The writer's own.
  alignas(cache_line_pair_bytes) std::size_t current_ = 0;  ///< the edition that is being written, or was last
  std::uint64_t frame_ = 0;
  bool ascending_ = true;  ///< so far the states were added in ascending order of cell
  std::vector<PublishedState> added_;
  std::size_t listed_ = 0;           ///< how many of keys_ are in use
  std::vector<std::uint64_t> keys_;  ///< cell << 32 | index in added_, or in the writer's table
  std::vector<std::uint64_t> sorted_;
  std::vector<std::uint32_t> entries_;  ///< of the directory, by key
};

}  // namespace ringfence::link
