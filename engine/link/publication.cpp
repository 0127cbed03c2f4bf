#include "link/publication.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

#include "base/prefetch.hpp"
#include "base/radix_pass.hpp"

namespace ringfence::link {

namespace {

/// A directory costs 4 bytes a cell to fill; a search about 5 ns a step for each cell that a reader looks at.
constexpr std::size_t most_a_state = 4;

/// Keeps the reads of an edition before a second look at its stamp, and the loss of a stamp before writes.
/// Only a broken frame protocol needs it, and the thread sanitizer, which knows no fences, would report that as a race.
void keep_order() noexcept {
#if !defined(__SANITIZE_THREAD__)
  std::atomic_thread_fence(std::memory_order_acq_rel);
#endif
}

}  // namespace

Publication::Publication(std::size_t cells, std::size_t states, CellLayout layout)
    : cell_count_(cells), layout_(layout) {
  added_.reserve(states);
  keys_.resize(states);
  sorted_.resize(states);
  entries_.reserve(states);
  const std::size_t most_cells = std::min(cells, most_a_state * states) + 2;
  for (Edition& edition : editions_) {
    edition.states.reserve(states);
    edition.cells.reserve(most_cells);
    edition.starts.reserve(most_cells);
    edition.directory.reserve(most_cells);
  }
}

void Publication::begin(std::uint64_t frame) noexcept {
  current_ ^= frame != frame_ ? 1 : 0;
  editions_[current_].stamp.store(no_stamp, std::memory_order_relaxed);
  keep_order();
  frame_ = frame;
  ascending_ = true;
  added_.clear();
  listed_ = 0;
}

void Publication::add(std::uint32_t cell, const PublishedState& state) {
  add_index(cell, static_cast<std::uint32_t>(added_.size()));
  added_.push_back(state);
}

void Publication::publish() {
  if (ascending_) {
    Edition& edition = arrange();
    edition.states.swap(added_);
    show(edition);
  } else {
    publish_indexed([this](std::uint32_t i) { base::prefetch_for_read(&added_[i]); },
                    [this](std::uint32_t i) -> const PublishedState& { return added_[i]; });
  }
}

/// Puts the keys in ascending order of cell, within a cell in that of adding.
Publication::Edition& Publication::arrange() {
  Edition& edition = editions_[current_];
  edition.dense = false;
  if (listed_ == 0) {
    return edition;
  }
  const std::size_t cells = find_cell_range(edition);
  edition.dense = cells <= most_a_state * listed_;
  if (edition.dense) {
    count_keys(edition, cells);
  } else if (!ascending_) {
    sort_keys();
  }
  return edition;
}

/// Returns how many cells that is. Precondition: something is listed.
std::size_t Publication::find_cell_range(Edition& edition) const noexcept {
  const CellLayout layout = layout_;
  CellLayout::Place lower = layout.place_of(cell_of(keys_.front()));
  CellLayout::Place upper = lower;
  for (const std::uint64_t key : keys()) {
    const CellLayout::Place place = layout.place_of(cell_of(key));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower.at[axis] = std::min(lower.at[axis], place.at[axis]);
      upper.at[axis] = std::max(upper.at[axis], place.at[axis]);
    }
  }
  Box& box = edition.box;
  std::copy_n(lower.at, 3, box.cell_range.lower);
  std::copy_n(upper.at, 3, box.cell_range.upper);
  box.wide = upper.at[0] - lower.at[0] + 1;
  box.rows = upper.at[1] - lower.at[1] + 1;
  return std::size_t{box.wide} * box.rows * (upper.at[2] - lower.at[2] + std::size_t{1});
}

/// Precondition: the edition has its states.
void Publication::show(Edition& edition) {
  edition.dense ? list_counted(edition) : list_cells(edition);
  // Pairs with the load in find: the edition is whole.
  edition.stamp.store(frame_, std::memory_order_release);
}

/// Fills the directory, and sorts by it. Where it sorts, a cell is counted two entries further on: when all is summed
/// up that is where the next one begins, and the entry between them becomes it as the cell's keys take their places.
void Publication::count_keys(Edition& edition, std::size_t cells) {
  std::vector<std::uint32_t>& next = edition.directory;
  const std::size_t on = ascending_ ? 1 : 2;
  next.assign(cells + on, 0);
  entries_.resize(listed_);
  const CellLayout layout = layout_;
  const Box box = edition.box;
  for (std::size_t i = 0; i < listed_; ++i) {
    entries_[i] = static_cast<std::uint32_t>(box.entry(layout.place_of(cell_of(keys_[i]))));
  }
  std::uint32_t* const counts = next.data() + on;
  for (const std::uint32_t entry : entries_) ++counts[entry];
  for (std::size_t cell = 0; cell < cells; ++cell) next[cell + on] += next[cell + on - 1];
  if (ascending_) {
    return;
  }
  sorted_.resize(keys_.size());
  std::uint32_t* const places = next.data() + 1;
  std::uint64_t* const sorted = sorted_.data();
  for (std::size_t i = 0; i < listed_; ++i) sorted[places[entries_[i]]++] = keys_[i];
  next.pop_back();
  keys_.swap(sorted_);
}

/// By cell, and within a cell by index: radix with digits of 11 bits, least first, where comparing would cost more.
void Publication::sort_keys() {
  constexpr std::size_t few = 400;
  if (listed_ <= few) {
    std::sort(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(listed_));
    return;
  }
  constexpr unsigned digit_bits = 11;
  constexpr std::uint64_t digits = std::uint64_t{1} << digit_bits;
  const unsigned cell_bits = static_cast<unsigned>(std::bit_width(cell_count_ - 1));
  sorted_.resize(keys_.size());
  for (unsigned shift = 32; shift < 32 + cell_bits; shift += digit_bits) {
    base::radix_pass(keys(), sorted_.data(), digits,
                     [shift](std::uint64_t key) { return key >> shift & (digits - 1); });
    keys_.swap(sorted_);
  }
}

/// Precondition: keys_ are in ascending order of cell, as the edition's states.
void Publication::list_cells(Edition& edition) {
  edition.cells.clear();
  edition.starts.clear();
  for (std::size_t i = 0; i < listed_; ++i) {
    const std::uint32_t cell = cell_of(keys_[i]);
    if (i != 0 && cell == edition.cells.back()) continue;
    edition.cells.push_back(cell);
    edition.starts.push_back(static_cast<std::uint32_t>(i));
  }
  edition.starts.push_back(static_cast<std::uint32_t>(listed_));
}

/// The same from the directory. Written for every cell of the reach, and over again where that holds nothing: a branch
/// would be missed as often as not.
void Publication::list_counted(Edition& edition) {
  const CellRange& cell_range = edition.box.cell_range;
  const std::uint32_t* before = edition.directory.data();
  edition.cells.resize(edition.directory.size());
  edition.starts.resize(edition.directory.size());
  std::uint32_t* const cells = edition.cells.data();
  std::uint32_t* const starts = edition.starts.data();
  const std::uint32_t wide = edition.box.wide;
  std::size_t listed = 0;
  for (std::uint32_t z = cell_range.lower[2]; z <= cell_range.upper[2]; ++z) {
    for (std::uint32_t y = cell_range.lower[1]; y <= cell_range.upper[1]; ++y) {
      const std::uint32_t at[3] = {cell_range.lower[0], y, z};
      const std::uint32_t first = layout_.cell_at(at);
      for (std::uint32_t x = 0; x < wide; ++x, ++before) {
        cells[listed] = first + x;
        starts[listed] = before[0];
        listed += before[1] != before[0] ? 1 : 0;
      }
    }
  }
  edition.cells.resize(listed);
  edition.starts.resize(listed + 1);
  edition.starts.back() = static_cast<std::uint32_t>(listed_);
}

std::span<const PublishedState> Publication::search(const Edition& edition, std::uint32_t first,
                                                    std::uint32_t last) noexcept {
  const PublishedState* states = edition.states.data();
  const auto begin = edition.cells.begin(), end = edition.cells.end();
  const auto from = std::lower_bound(begin, end, first);
  const auto to = first == last ? from + (from != end && *from == first) : std::upper_bound(from, end, last);
  return {states + edition.starts[static_cast<std::size_t>(from - begin)],
          states + edition.starts[static_cast<std::size_t>(to - begin)]};
}

std::span<const PublishedState> Publication::states(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? std::span<const PublishedState>(edition->states) : std::span<const PublishedState>();
}

CellRange Publication::cell_range(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? edition->box.cell_range : CellRange{};
}

std::span<const std::uint32_t> Publication::cells(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? std::span<const std::uint32_t>(edition->cells) : std::span<const std::uint32_t>();
}

std::span<const std::uint32_t> Publication::starts(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? std::span<const std::uint32_t>(edition->starts) : std::span<const std::uint32_t>();
}

bool Publication::is_intact(std::uint64_t frame) const noexcept {
  keep_order();
  return find(frame) != nullptr;
}

}  // namespace ringfence::link
