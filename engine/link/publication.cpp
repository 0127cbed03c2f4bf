#include "link/publication.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

#include "base/prefetch.hpp"
#include "base/radix_pass.hpp"

namespace ringfence::link {

namespace {

/// Largest directory, in entries per state, that is worth filling. Each entry takes 4 bytes, which are written in each
/// frame. Without a directory a reader needs a binary search for each look-up, at about 5 ns a step.
constexpr std::size_t max_directory_entries_per_state = 4;

/// So few states are found without a directory.
constexpr std::size_t few_states = 8;

/// Reader: orders its reads of a buffer before its second test of the stamp. Writer: orders the reset of the stamp
/// before its writes to the buffer. Needed only if the frame protocol is violated. Left out under the thread sanitizer,
/// which does not support fences and would report that case as a race.
void fence() noexcept {
#if !defined(__SANITIZE_THREAD__)
  std::atomic_thread_fence(std::memory_order_acq_rel);
#endif
}

}  // namespace

Publication::Publication(std::size_t cells, std::size_t states, CellLayout layout, std::size_t kept_frames)
    : cell_count_(cells), layout_(layout), kept_frames_(kept_frames) {
  assert(kept_frames == 1 || kept_frames == 2);
  added_.reserve(states);
  cells_.reserve(states);
  indices_.reserve(states);
  sorted_indices_.reserve(states);
  keys_.reserve(states);
  sorted_keys_.reserve(states);
  const std::size_t max_cells = std::min(cells, max_directory_entries_per_state * states) + 2;
  for (FrameBuffer& buffer : std::span(buffers_).first(kept_frames)) {
    buffer.states.reserve(states);
    buffer.cells.reserve(max_cells);
    buffer.starts.reserve(max_cells);
    buffer.directory.reserve(max_cells);
  }
}

void Publication::begin(std::uint64_t frame) noexcept {
  current_ = frame != frame_ ? next_buffer() : current_;
  buffers_[current_].stamp.store(no_stamp, std::memory_order_relaxed);
  fence();
  frame_ = frame;
  ascending_ = true;
  added_.clear();
  added_count_ = 0;
}

void Publication::add(std::uint32_t cell, const PublishedState& state) {
  add_index(cell, static_cast<std::uint32_t>(added_.size()));
  added_.push_back(state);
}

void Publication::publish() {
  if (ascending_) {
    FrameBuffer& buffer = sort_added();
    buffer.states.swap(added_);
    places_.clear();
    finish(buffer);
  } else {
    places_.resize(added_.size());
    std::uint32_t place = 0;
    publish_indexed([this](std::uint32_t i) { base::prefetch_for_read(&added_[i]); },
                    [&](std::uint32_t i) -> const PublishedState& {
                      places_[i] = place++;
                      return added_[i];
                    });
  }
}

/// Sorts what was added by cell; states of one cell stay in the order of adding. Also fills the directory of the
/// current buffer if it is small enough. Returns the buffer.
Publication::FrameBuffer& Publication::sort_added() {
  FrameBuffer& buffer = buffers_[current_];
  buffer.dense = false;
  if (added_count_ == 0) {
    return buffer;
  }
  const std::size_t cells = find_cell_range(buffer);
  buffer.dense = added_count_ > few_states && cells <= max_directory_entries_per_state * added_count_;
  if (buffer.dense) {
    sort_by_counting(buffer, cells);
  } else if (!ascending_) {
    sort_by_keys();
  }
  return buffer;
}

/// Sets the buffer's box to the smallest box that contains the cells of all added states. Returns the number of cells
/// in the box. Precondition: there is at least one state.
std::size_t Publication::find_cell_range(FrameBuffer& buffer) const noexcept {
  const CellLayout layout = layout_;
  CellLayout::Place lower = layout.place_of(cells_.front());
  CellLayout::Place upper = lower;
  for (const std::uint32_t cell : std::span(cells_).first(added_count_)) {
    const CellLayout::Place place = layout.place_of(cell);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower.at[axis] = std::min(lower.at[axis], place.at[axis]);
      upper.at[axis] = std::max(upper.at[axis], place.at[axis]);
    }
  }
  Box& box = buffer.box;
  std::copy_n(lower.at, 3, box.cell_range.lower);
  std::copy_n(upper.at, 3, box.cell_range.upper);
  box.row_length = upper.at[0] - lower.at[0] + 1;
  box.rows = upper.at[1] - lower.at[1] + 1;
  return std::size_t{box.row_length} * box.rows * (upper.at[2] - lower.at[2] + std::size_t{1});
}

/// Writes the buffer's lists of cells and starts, then its stamp. Precondition: its states are written.
void Publication::finish(FrameBuffer& buffer) {
  buffer.dense ? collect_cells_dense(buffer) : collect_cells(buffer);
  // Pairs with the load in find_buffer: the buffer is complete.
  buffer.stamp.store(frame_, std::memory_order_release);
}

/// Fills the directory and, if the cells do not ascend, sorts the indices by counting. To sort, the number of states of
/// entry e is counted in element e + 2. After the prefix sum, element e + 1 is the first position of the states of
/// entry e. Each state that is placed increments this element, so in the end it is the first position of the states of
/// entry e + 1, which is the value that the directory needs.
void Publication::sort_by_counting(FrameBuffer& buffer, std::size_t cells) {
  std::vector<std::uint32_t>& next = buffer.directory;
  const std::size_t shift = ascending_ ? 1 : 2;
  next.assign(cells + shift, 0);
  const CellLayout layout = layout_;
  const Box box = buffer.box;
  const std::span<std::uint32_t> entries(cells_.data(), added_count_);
  for (std::uint32_t& cell : entries) cell = static_cast<std::uint32_t>(box.entry(layout.place_of(cell)));
  std::uint32_t* const counts = next.data() + shift;
  for (const std::uint32_t entry : entries) ++counts[entry];
  for (std::size_t cell = 0; cell < cells; ++cell) next[cell + shift] += next[cell + shift - 1];
  if (ascending_) {
    return;
  }
  sorted_indices_.resize(indices_.size());
  std::uint32_t* const places = next.data() + 1;
  std::uint32_t* const sorted = sorted_indices_.data();
  for (std::size_t i = 0; i < entries.size(); ++i) sorted[places[entries[i]]++] = indices_[i];
  next.pop_back();
  indices_.swap(sorted_indices_);
}

/// Sorts few states by comparison, by cell and then index; more by radix sort, by cell only, with digits of 11 bits,
/// least significant first. The order is the same, because radix sort is stable and indices are added in ascending
/// order.
void Publication::sort_by_keys() {
  constexpr std::size_t max_comparison_sort = 400;
  keys_.resize(added_count_);
  for (std::size_t i = 0; i < added_count_; ++i) keys_[i] = std::uint64_t{cells_[i]} << 32 | indices_[i];
  if (added_count_ <= max_comparison_sort) {
    std::sort(keys_.begin(), keys_.end());
  } else {
    constexpr unsigned digit_bits = 11;
    constexpr std::uint64_t digits = std::uint64_t{1} << digit_bits;
    const unsigned cell_bits = static_cast<unsigned>(std::bit_width(cell_count_ - 1));
    sorted_keys_.resize(added_count_);
    for (unsigned shift = 32; shift < 32 + cell_bits; shift += digit_bits) {
      base::radix_pass(std::span<const std::uint64_t>(keys_), sorted_keys_.data(), digits,
                       [shift](std::uint64_t key) { return key >> shift & (digits - 1); });
      keys_.swap(sorted_keys_);
    }
  }
  for (std::size_t i = 0; i < added_count_; ++i) {
    cells_[i] = static_cast<std::uint32_t>(keys_[i] >> 32);
    indices_[i] = static_cast<std::uint32_t>(keys_[i]);
  }
}

/// Lists the cells that have states, and the position of the first state of each. Precondition: cells_ ascend.
void Publication::collect_cells(FrameBuffer& buffer) {
  buffer.cells.clear();
  buffer.starts.clear();
  for (std::size_t i = 0; i < added_count_; ++i) {
    const std::uint32_t cell = cells_[i];
    if (i != 0 && cell == buffer.cells.back()) continue;
    buffer.cells.push_back(cell);
    buffer.starts.push_back(static_cast<std::uint32_t>(i));
  }
  buffer.starts.push_back(static_cast<std::uint32_t>(added_count_));
  list_blocks(buffer);
}

/// Like collect_cells, but from the directory. Writes every cell of the box to the list; the next cell overwrites it if
/// it has no states. A branch would be mispredicted about half the time.
void Publication::collect_cells_dense(FrameBuffer& buffer) {
  const CellRange& cell_range = buffer.box.cell_range;
  const std::uint32_t* entry = buffer.directory.data();
  buffer.cells.resize(buffer.directory.size());
  buffer.starts.resize(buffer.directory.size());
  std::uint32_t* const cells = buffer.cells.data();
  std::uint32_t* const starts = buffer.starts.data();
  const std::uint32_t row_length = buffer.box.row_length;
  std::size_t count = 0;
  for (std::uint32_t z = cell_range.lower[2]; z <= cell_range.upper[2]; ++z) {
    for (std::uint32_t y = cell_range.lower[1]; y <= cell_range.upper[1]; ++y) {
      const std::uint32_t at[3] = {cell_range.lower[0], y, z};
      const std::uint32_t first = layout_.cell_at(at);
      for (std::uint32_t x = 0; x < row_length; ++x, ++entry) {
        cells[count] = first + x;
        starts[count] = entry[0];
        count += entry[1] != entry[0] ? 1 : 0;
      }
    }
  }
  buffer.cells.resize(count);
  buffer.starts.resize(count + 1);
  buffer.starts.back() = static_cast<std::uint32_t>(added_count_);
}

/// About as many blocks as cells with states, so that a search in a block is short unless the block is crowded. A few
/// cells are searched without.
void Publication::list_blocks(FrameBuffer& buffer) const {
  const std::size_t size = buffer.cells.size();
  buffer.block_log2 = no_blocks;
  if (size <= few_states) {
    return;
  }
  unsigned log2 = 0;
  while ((cell_count_ - 1) >> log2 >= size) ++log2;
  buffer.block_log2 = log2;
  const std::size_t blocks = ((cell_count_ - 1) >> log2) + 1;
  buffer.directory.resize(blocks + 1);
  std::size_t block = 0;
  for (std::size_t i = 0; i < size; ++i) {
    for (; block <= buffer.cells[i] >> log2; ++block) buffer.directory[block] = static_cast<std::uint32_t>(i);
  }
  std::fill(buffer.directory.begin() + static_cast<std::ptrdiff_t>(block), buffer.directory.end(),
            static_cast<std::uint32_t>(size));
}

std::span<const std::uint32_t> Publication::block_of(const FrameBuffer& buffer, std::uint32_t cell) noexcept {
  const std::span<const std::uint32_t> cells = buffer.cells;
  if (buffer.block_log2 == no_blocks) return cells;
  const std::size_t last_block = buffer.directory.size() - 2;
  const std::uint32_t* const starts =
      buffer.directory.data() + std::min<std::size_t>(cell >> buffer.block_log2, last_block);
  return cells.subspan(starts[0], starts[1] - starts[0]);
}

std::span<const PublishedState> Publication::read_sparse(const FrameBuffer& buffer, std::uint32_t first,
                                                         std::uint32_t last) noexcept {
  const auto of_first = block_of(buffer, first), of_last = block_of(buffer, last);
  const std::uint32_t* const cells = buffer.cells.data();
  const auto from = std::lower_bound(of_first.data(), of_first.data() + of_first.size(), first) - cells;
  const auto to = std::upper_bound(of_last.data(), of_last.data() + of_last.size(), last) - cells;
  const PublishedState* const states = buffer.states.data();
  return {states + buffer.starts[static_cast<std::size_t>(from)], states + buffer.starts[static_cast<std::size_t>(to)]};
}

std::span<const PublishedState> Publication::states(std::uint64_t frame) const noexcept {
  const FrameBuffer* buffer = find_buffer(frame);
  return buffer ? std::span<const PublishedState>(buffer->states) : std::span<const PublishedState>();
}

CellRange Publication::cell_range(std::uint64_t frame) const noexcept {
  const FrameBuffer* buffer = find_buffer(frame);
  return buffer ? buffer->box.cell_range : CellRange{};
}

std::span<const std::uint32_t> Publication::cells(std::uint64_t frame) const noexcept {
  const FrameBuffer* buffer = find_buffer(frame);
  return buffer ? std::span<const std::uint32_t>(buffer->cells) : std::span<const std::uint32_t>();
}

std::span<const std::uint32_t> Publication::starts(std::uint64_t frame) const noexcept {
  const FrameBuffer* buffer = find_buffer(frame);
  return buffer ? std::span<const std::uint32_t>(buffer->starts) : std::span<const std::uint32_t>();
}

bool Publication::is_intact(std::uint64_t frame) const noexcept {
  fence();
  return find_buffer(frame) != nullptr;
}

}  // namespace ringfence::link
