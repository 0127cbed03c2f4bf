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

#include "base/prefetch.hpp"
#include "link/atomics.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::link {

/// How cells are numbered in rows and layers: the lowest `row_log2` bits count cells along a row, the next `layer_log2`
/// bits count rows in a layer. Each publication usually covers a box of such cells. Default: all cells are in one row.
struct CellLayout {
  unsigned row_log2 = 31;
  unsigned layer_log2 = 0;

  struct Place {
    std::uint32_t at[3];  ///< position in the row, row in the layer, layer
  };
  constexpr Place place_of(std::uint32_t cell) const noexcept {
    return {{cell & ((std::uint32_t{1} << row_log2) - 1), cell >> row_log2 & ((std::uint32_t{1} << layer_log2) - 1),
             static_cast<std::uint32_t>(std::uint64_t{cell} >> (row_log2 + layer_log2))}};
  }
  constexpr std::uint32_t cell_at(const std::uint32_t at[3]) const noexcept {
    return at[0] | at[1] << row_log2 | static_cast<std::uint32_t>(std::uint64_t{at[2]} << (row_log2 + layer_log2));
  }
};

/// The smallest box of cells that contains all cells with states of a frame. Both corners are included; coordinates as
/// in CellLayout::Place.
struct CellRange {
  std::uint32_t lower[3];
  std::uint32_t upper[3];
};

/// The state of one object that many threads read: where it is. The same layout as in the API.
using PublishedState = SeenState;

/// The states of one frame, grouped by cell: written once by one thread, then read in place by any number of threads.
///
/// Double-buffered: the last published frame and the one before it can be read. Where one thread writes and reads, the
/// last one is enough.
///
/// The frame protocol guarantees that all readers of frame k have finished before the writer begins frame k + 2, or
/// k + 1 if one frame is kept. (In lock-step they finish before the server lets frame k + 1 end.) A violation is
/// detected: a buffer carries its frame's stamp only while it is complete, `read` returns nothing without the stamp,
/// and a reader that has finished calls `is_intact`. If that returns false, what it read may be inconsistent and must
/// be discarded.
///
/// Cost: proportional to the number of states, not of cells. Adding copies a state. Publishing moves no state if they
/// were added in ascending order of cell. Otherwise it sorts keys (by counting if there are few cells a state, else by
/// radix or comparison) and moves each state once. Reading a cell is one index if the states are dense, else a binary
/// search over the non-empty cells of a block that has one on average. Only the cells in the smallest box that contains
/// all states count for this, so many writers that each cover a box cost no more than one writer that covers all cells.
/// Readers copy nothing and write no cache line, so they do not disturb each other.
///
/// Threads: one writer thread calls begin, add and publish; any thread may call const functions. Memory: reserved by
/// the constructor; grows between frames and never shrinks.
class Publication {
 public:
  /// For cells 0 to `cells` - 1, at most 2^31. Reserves memory for `states` states a frame; more may be added, at the
  /// cost of an allocation. `kept_frames`: the number of frames that can be read, 1 or 2.
  Publication(std::size_t cells, std::size_t states, CellLayout layout = {}, std::size_t kept_frames = 2);

  /// Writer: starts `frame`, which is not less than any earlier one and less than 2^64 - 1. The states of `kept_frames`
  /// frames ago are discarded. If `frame` is the current frame, it is published again from the start; no reader may
  /// have begun to read it.
  void begin(std::uint64_t frame) noexcept;
  /// Writer: adds a state of `cell`. Any order of cells; states of one cell keep their order of adding.
  void add(std::uint32_t cell, const PublishedState& state);
  /// Writer: groups the added states by cell and makes them visible, by one store.
  void publish();
  /// Writer, after publish(): the position in states() of the state that was added as number `added`, from 0.
  std::uint32_t place_of(std::uint32_t added) const noexcept { return places_.empty() ? added : places_[added]; }

  /// Writer, instead of add(): adds the state of `cell` that is entry `index` of a table which the writer keeps.
  void add_index(std::uint32_t cell, std::uint32_t index) {
    assert(cell < cell_count_);
    if (added_count_ == indices_.size()) grow();
    ascending_ &= added_count_ == 0 || cells_[added_count_ - 1] <= cell;
    cells_[added_count_] = cell;
    indices_[added_count_++] = index;
  }
  /// Writer: like add_index() for all `size` entries of the table. `cell_at(i)` is the cell of entry i, or `no_cell` to
  /// skip it.
  template <class CellAt>
  void add_table(std::uint32_t size, CellAt cell_at) {
    if (indices_.size() < added_count_ + size) resize_added(added_count_ + size);
    std::uint32_t* const cells = cells_.data();
    std::uint32_t* const indices = indices_.data();
    std::size_t count = added_count_;
    std::uint32_t last = count == 0 ? 0 : cells[count - 1];
    bool ascending = ascending_;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t cell = cell_at(i);
      if (cell == no_cell) continue;
      assert(cell < cell_count_);
      ascending &= last <= cell;  // no branch: cells ascend about half the time
      last = cell;
      cells[count] = cell;
      indices[count++] = i;
    }
    ascending_ = ascending;
    added_count_ = count;
  }
  static constexpr std::uint32_t no_cell = 0xffffffffu;
  /// Writer: prefetches the arrays that a frame of few states writes next.
  void prefetch_arrays() const noexcept {
    const FrameBuffer& buffer = buffers_[next_buffer()];
    for (const void* const array :
         {static_cast<const void*>(added_.data()), static_cast<const void*>(cells_.data()),
          static_cast<const void*>(indices_.data()), static_cast<const void*>(buffer.states.data()),
          static_cast<const void*>(buffer.cells.data()), static_cast<const void*>(buffer.starts.data())}) {
      base::prefetch_for_read(array);
    }
  }
  /// Writer, instead of publish(): the same for entries added by index. `state_of(index)` returns the PublishedState of
  /// an entry and is called once for each; `prefetch(index)` is called some entries earlier.
  template <class Fetch, class StateOf>
  void publish_indexed(Fetch prefetch, StateOf state_of) {
    constexpr std::size_t ahead = 32;  // entries of a cell are anywhere in the table
    FrameBuffer& buffer = sort_added();
    const std::size_t size = added_count_;
    buffer.states.resize(size);
    PublishedState* const states = buffer.states.data();
    const std::uint32_t* const indices = indices_.data();
    for (std::size_t i = 0; i < size; ++i) {
      if (i + ahead < size) prefetch(indices[i + ahead]);
      states[i] = state_of(indices[i]);
    }
    finish(buffer);
  }

  /// Reader: whether `frame` can be read: it is the last published frame or, if two are kept, the one before.
  bool published(std::uint64_t frame) const noexcept { return find_buffer(frame) != nullptr; }
  /// Reader: the states of one cell; empty if it has none or `frame` cannot be read.
  std::span<const PublishedState> read(std::uint64_t frame, std::uint32_t cell) const noexcept {
    return read(frame, cell, cell);
  }
  /// Reader: the states of the cells `first` to `last`, both included, in ascending order of cell. One look-up reads
  /// one row of the cells near an avatar.
  std::span<const PublishedState> read(std::uint64_t frame, std::uint32_t first, std::uint32_t last) const noexcept {
    const FrameBuffer* buffer = find_buffer(frame);
    return buffer ? read_range(*buffer, first, last) : std::span<const PublishedState>();
  }
  /// Reader: like read() for many ranges of cells. `cells_of(i)`, for i from 0 to `rows` - 1, returns the first and
  /// last cell of range i. Calls `use(states)` for each range that is not empty.
  template <class CellsOf, class Use>
  void read_rows(std::uint64_t frame, std::size_t rows, CellsOf cells_of, Use use) const {
    const FrameBuffer* buffer = find_buffer(frame);
    for (std::size_t i = 0; buffer && i < rows; ++i) {
      const auto [first, last] = cells_of(i);
      const auto states = read_range(*buffer, first, last);
      if (!states.empty()) use(states);
    }
  }
  /// Reader: all states of a frame in ascending order of cell.
  std::span<const PublishedState> states(std::uint64_t frame) const noexcept;
  /// Reader: the smallest box of cells that contains all states. Precondition: the frame has a state.
  CellRange cell_range(std::uint64_t frame) const noexcept;
  /// Reader: the cells of a frame that have states, ascending.
  std::span<const std::uint32_t> cells(std::uint64_t frame) const noexcept;
  /// Reader: the index in states() of the first state of each of those cells. One more entry marks the end of the last
  /// cell.
  std::span<const std::uint32_t> starts(std::uint64_t frame) const noexcept;
  /// Reader, after use of what it read of `frame`: whether that was consistent throughout.
  bool is_intact(std::uint64_t frame) const noexcept;

 private:
  /// The box of cells that the directory covers.
  struct Box {
    CellRange cell_range{};
    std::uint32_t rows = 0;        ///< rows in a layer
    std::uint32_t row_length = 0;  ///< cells in a row

    /// The directory entry of a cell in the box.
    std::size_t entry(const CellLayout::Place& place) const noexcept {
      return (std::size_t{place.at[2] - cell_range.lower[2]} * rows + (place.at[1] - cell_range.lower[1])) *
                 row_length +
             (place.at[0] - cell_range.lower[0]);
    }
  };

  /// The states of one frame. `starts[i]` is the index of the first state of `cells[i]`; one more entry marks the end.
  struct alignas(cache_line_pair_bytes) FrameBuffer {
    std::atomic<std::uint64_t> stamp{no_stamp};  ///< the frame, while the other members are complete
    bool dense = false;                          ///< whether `directory` has an entry for each cell
    unsigned block_log2 = no_blocks;             ///< if not dense
    Box box;
    std::vector<PublishedState> states;
    std::vector<std::uint32_t> cells;
    std::vector<std::uint32_t> starts;
    /// If dense: for each cell of the box, the number of states before it. Otherwise, unless block_log2 is no_blocks:
    /// for each block of 2^block_log2 cells, the number of `cells` before it. One more entry for all.
    std::vector<std::uint32_t> directory;
  };

  static constexpr std::uint64_t no_stamp = ~std::uint64_t{0};
  static constexpr unsigned no_blocks = 32;

  // Up to what is reserved, in steps: a publication that is never filled occupies no memory.
  void grow() {
    const std::size_t size = 2 * added_count_ + 64, capacity = indices_.capacity();
    resize_added(added_count_ < capacity ? std::min(size, capacity) : size);
  }
  void resize_added(std::size_t size) {
    cells_.resize(size);
    indices_.resize(size);
  }
  const FrameBuffer* find_buffer(std::uint64_t frame) const noexcept {
    // Pairs with the store in finish().
    for (const FrameBuffer& buffer : buffers_) {
      if (buffer.stamp.load(std::memory_order_acquire) == frame) return &buffer;
    }
    return nullptr;
  }
  /// The number of states before a cell. Precondition: the buffer is dense.
  std::uint32_t states_before(const FrameBuffer& buffer, std::uint32_t cell) const noexcept {
    const CellRange& cell_range = buffer.box.cell_range;
    CellLayout::Place place = layout_.place_of(cell);
    // If the cell is outside the box on an axis, its position on the lower axes does not matter.
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
    return buffer.directory[buffer.box.entry(place)];
  }
  std::span<const PublishedState> read_range(const FrameBuffer& buffer, std::uint32_t first,
                                             std::uint32_t last) const noexcept {
    assert(first <= last);
    if (!buffer.dense) return read_sparse(buffer, first, last);
    const PublishedState* states = buffer.states.data();
    return {states + states_before(buffer, first), states + states_before(buffer, last + 1)};
  }
  static std::span<const PublishedState> read_sparse(const FrameBuffer& buffer, std::uint32_t first,
                                                     std::uint32_t last) noexcept;
  FrameBuffer& sort_added();
  void finish(FrameBuffer& buffer);
  std::size_t find_cell_range(FrameBuffer& buffer) const noexcept;
  std::size_t next_buffer() const noexcept { return kept_frames_ == 2 ? current_ ^ 1 : current_; }
  void sort_by_counting(FrameBuffer& buffer, std::size_t cells);
  void sort_by_keys();
  void collect_cells(FrameBuffer& buffer);
  void collect_cells_dense(FrameBuffer& buffer);
  void list_blocks(FrameBuffer& buffer) const;
  /// The cells of a buffer that is not dense among which `cell` is, if it has states.
  static std::span<const std::uint32_t> block_of(const FrameBuffer& buffer, std::uint32_t cell) noexcept;

  std::array<FrameBuffer, 2> buffers_;  ///< if one frame is kept, only the first is used
  std::size_t cell_count_;
  CellLayout layout_;
  std::size_t kept_frames_;

  // Used by the writer only.
  alignas(cache_line_pair_bytes) std::size_t current_ = 0;  ///< the buffer that is being written, or was written last
  std::uint64_t frame_ = 0;
  bool ascending_ = true;  ///< whether the states so far were added in ascending order of cell
  std::vector<PublishedState> added_;
  std::vector<std::uint32_t> places_;  ///< of the added states; empty: they stay in the order of adding
  std::size_t added_count_ = 0;        ///< number of used entries of cells_ and indices_
  /// Cell of each added state. If they are dense, publishing replaces it by its entry in the directory.
  std::vector<std::uint32_t> cells_;
  std::vector<std::uint32_t> indices_;  ///< of the added states, in added_ or in the writer's table
  std::vector<std::uint32_t> sorted_indices_;
  std::vector<std::uint64_t> keys_, sorted_keys_;  ///< cell << 32 | index; used if the states are not dense
};

}  // namespace ringfence::link
