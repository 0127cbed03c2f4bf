#include "link/publication.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

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

Publication::Publication(std::size_t cells, std::size_t states) : cell_count_(cells) {
  added_.reserve(states);
  keys_.reserve(states);
  sorted_.reserve(states);
  for (Edition& edition : editions_) {
    edition.states.reserve(states);
    edition.cells.reserve(std::min(states, cells));
    edition.starts.reserve(std::min(states, cells) + 1);
    edition.directory.reserve(std::min(cells, most_a_state * states) + 1);
  }
}

void Publication::begin(std::uint64_t frame) noexcept {
  current_ ^= frame != frame_ ? 1 : 0;
  editions_[current_].stamp.store(no_stamp, std::memory_order_relaxed);
  keep_order();
  frame_ = frame;
  ascending_ = true;
  added_.clear();
  keys_.clear();
}

void Publication::add(std::uint32_t cell, const PublishedState& state) {
  list(cell, static_cast<std::uint32_t>(added_.size()));
  added_.push_back(state);
}

void Publication::publish() {
  if (ascending_) {
    Edition& edition = arrange();
    edition.states.swap(added_);
    show(edition);
  } else {
    publish_listed([this](std::uint32_t i) { __builtin_prefetch(&added_[i]); },
                   [this](std::uint32_t i) -> const PublishedState& { return added_[i]; });
  }
}

/// Puts the keys in ascending order of cell, within a cell in that of adding.
Publication::Edition& Publication::arrange() {
  Edition& edition = editions_[current_];
  edition.dense = false;
  if (keys_.empty()) {
    return edition;
  }
  std::uint32_t least = cell_of(keys_.front());
  std::uint32_t greatest = cell_of(keys_.back());
  if (!ascending_) {
    for (const std::uint64_t key : keys_) {
      least = std::min(least, cell_of(key));
      greatest = std::max(greatest, cell_of(key));
    }
  }
  const std::size_t cells = greatest - least + std::size_t{1};
  edition.dense = cells <= most_a_state * keys_.size();
  edition.first = least;
  if (!ascending_) {
    edition.dense ? count_keys(edition, cells) : sort_keys();
  }
  return edition;
}

/// Precondition: the edition has its states.
void Publication::show(Edition& edition) {
  list_cells(edition);
  // Pairs with the load in find: the edition is whole.
  edition.stamp.store(frame_, std::memory_order_release);
}

void Publication::count_keys(Edition& edition, std::size_t cells) {
  std::vector<std::uint32_t>& next = edition.directory;
  const std::uint32_t first = edition.first;
  next.assign(cells + 1, 0);
  for (const std::uint64_t key : keys_) ++next[cell_of(key) - first + 1];
  for (std::size_t cell = 0; cell < cells; ++cell) next[cell + 1] += next[cell];
  sorted_.resize(keys_.size());
  for (const std::uint64_t key : keys_) sorted_[next[cell_of(key) - first]++] = key;
  keys_.swap(sorted_);
}

/// By cell, and within a cell by index: radix with digits of 11 bits, least first, where comparing would cost more.
void Publication::sort_keys() {
  constexpr std::size_t few = 400;
  if (keys_.size() <= few) {
    std::sort(keys_.begin(), keys_.end());
    return;
  }
  constexpr unsigned digit_bits = 11;
  constexpr std::uint64_t digits = std::uint64_t{1} << digit_bits;
  const unsigned cell_bits = static_cast<unsigned>(std::bit_width(cell_count_ - 1));
  sorted_.resize(keys_.size());
  for (unsigned shift = 32; shift < 32 + cell_bits; shift += digit_bits) {
    std::array<std::uint32_t, digits> place{};
    for (const std::uint64_t key : keys_) ++place[key >> shift & (digits - 1)];
    std::uint32_t sum = 0;
    for (std::uint32_t& count : place) sum += std::exchange(count, sum);
    for (const std::uint64_t key : keys_) sorted_[place[key >> shift & (digits - 1)]++] = key;
    keys_.swap(sorted_);
  }
}

/// Precondition: keys_ are in ascending order of cell, as the edition's states.
void Publication::list_cells(Edition& edition) {
  edition.cells.clear();
  edition.starts.clear();
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const std::uint32_t cell = cell_of(keys_[i]);
    if (i != 0 && cell == edition.cells.back()) continue;
    edition.cells.push_back(cell);
    edition.starts.push_back(static_cast<std::uint32_t>(i));
  }
  edition.starts.push_back(static_cast<std::uint32_t>(keys_.size()));
  if (!edition.dense) return;
  edition.directory.resize(edition.cells.back() - edition.first + std::size_t{2});
  std::size_t cell = 0;
  for (std::size_t i = 0; i < edition.cells.size(); ++i) {
    while (cell <= edition.cells[i] - edition.first) edition.directory[cell++] = edition.starts[i];
  }
  edition.directory[cell] = edition.starts.back();
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

std::span<const std::uint32_t> Publication::cells(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? std::span<const std::uint32_t>(edition->cells) : std::span<const std::uint32_t>();
}

std::span<const std::uint32_t> Publication::starts(std::uint64_t frame) const noexcept {
  const Edition* edition = find(frame);
  return edition ? std::span<const std::uint32_t>(edition->starts) : std::span<const std::uint32_t>();
}

bool Publication::intact(std::uint64_t frame) const noexcept {
  keep_order();
  return find(frame) != nullptr;
}

}  // namespace ringfence::link
