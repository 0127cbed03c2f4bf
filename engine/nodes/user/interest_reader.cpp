#include "nodes/user/interest_reader.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "ringfence/object.hpp"

namespace ringfence::nodes {

using link::PublishedState;
using regions::CellBox;

SeenPart InterestReader::read(const Host& host, const OwnStates& own) {
  const SeenList& seen = seen_[frame_ & 1];
  const std::size_t first = seen.size();
  list_boxes(host);
  if (!boxes_.empty()) {
    list_own_places(own);
    if (boxes_.size() > 1) {
      read_union();
    } else {
      each_publication([this](const Published& published) { read_box(published, boxes_.front()); });
    }
  }
  return {&seen, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(seen.size() - first)};
}

namespace {

/// Positions that have the same box of cells, as far as known: with two of them, all between them, because cells are a
/// monotone function of each coordinate.
struct SameBox {
  Vec3d least, most;

  bool contains(const Vec3d& p) const noexcept {
    return least.x <= p.x && p.x <= most.x && least.y <= p.y && p.y <= most.y && least.z <= p.z && p.z <= most.z;
  }
  void add(const Vec3d& p) noexcept {
    least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
    most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
  }
};

}  // namespace

// Avatars that stand together have the same box.
void InterestReader::list_boxes(const Host& host) {
  boxes_.clear();
  if (interest_ <= 0) {
    return;
  }
  const Publications& all = publications_;
  const double r = interest_;
  SameBox same{};  // as boxes_.back()
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Hosted& object = host[i];
    if (object.category == static_cast<std::uint16_t>(Category::avatar) &&
        (object.object.flags & messages::flag_present) != 0) {
      const Vec3d p = object.pose.position;
      if (!boxes_.empty() && same.contains(p)) {
        continue;
      }
      geometry::Bounds bounds;
      all.space->point({p.x - r, p.y - r, p.z - r}, bounds.lower);
      all.space->point({p.x + r, p.y + r, p.z + r}, bounds.upper);
      if (const CellBox box = all.grid.cells_of(bounds); boxes_.empty() || !(boxes_.back() == box)) {
        boxes_.push_back(box);
        same = {p, p};
      } else {
        same.add(p);
      }
    }
  }
}

void InterestReader::list_own_places(const OwnStates& own) {
  own_places_.clear();
  if (own_ == nullptr) {
    return;
  }
  for (std::uint32_t i = 0; i < own.count; ++i) {
    own_places_.push_back(own_->publication->place_of(own.first + i));
  }
  std::sort(own_places_.begin(), own_places_.end());
}

template <class Read>
void InterestReader::each_publication(Read read) {
  for (const Published* published : publications_.relays[frame_ & 1]) {
    skipped_ = published == own_ ? std::span<const std::uint32_t>(own_places_) : std::span<const std::uint32_t>();
    first_state_ = published->publication->states(frame_).data();
    read(*published);
  }
}

// Cuts out the user node's own states. Most user nodes have one.
void InterestReader::add(std::span<const PublishedState> states) {
  if (skipped_.empty()) {
    return add_if_any(states);
  }
  const auto begin = static_cast<std::uint32_t>(states.data() - first_state_);
  const auto end = static_cast<std::uint32_t>(begin + states.size());
  std::uint32_t from = begin;
  for (auto skipped = std::lower_bound(skipped_.begin(), skipped_.end(), begin);
       skipped != skipped_.end() && *skipped < end; ++skipped) {
    add_if_any(states.subspan(from - begin, *skipped - from));
    from = *skipped + 1;
  }
  add_if_any(states.subspan(from - begin));
}

void InterestReader::add_if_any(std::span<const PublishedState> states) {
  if (!states.empty()) {
    seen_[frame_ & 1].push_back(states);
  }
}

// Each cell once, however many boxes contain it: first marks the cells of all boxes, then reads the ranges of marked
// cells. The cost is proportional to the number of boxes, not to its square.
void InterestReader::read_union() {
  const regions::CellGrid& grid = publications_.grid;
  wanted_.assign((grid.cells() + 63) / 64, 0);
  for (const CellBox& box : boxes_) {
    for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
      for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
        want({grid.index(box.lower[0], y, z), grid.index(box.upper[0], y, z)});
      }
    }
  }
  list_ranges();
  each_publication([this](const Published& published) { read_ranges(published); });
}

void InterestReader::want(const CellSpan& cells) noexcept {
  constexpr std::uint64_t all = ~std::uint64_t{0};
  for (std::uint32_t word = cells.first / 64; word <= cells.last / 64; ++word) {
    const std::uint64_t from = word == cells.first / 64 ? all << cells.first % 64 : all;
    const std::uint64_t to = word == cells.last / 64 ? all >> (63 - cells.last % 64) : all;
    wanted_[word] |= from & to;
  }
}

void InterestReader::list_ranges() {
  ranges_.clear();
  for (std::uint32_t word = 0; word < wanted_.size(); ++word) {
    std::uint64_t left = wanted_[word];
    while (left != 0) {
      const auto first = static_cast<std::uint32_t>(std::countr_zero(left));
      const auto count = static_cast<std::uint32_t>(std::countr_one(left >> first));
      const CellSpan range{word * 64 + first, word * 64 + first + count - 1};
      if (!ranges_.empty() && ranges_.back().last + 1 == range.first) {
        ranges_.back().last = range.last;
      } else {
        ranges_.push_back(range);
      }
      left = first + count == 64 ? 0 : left >> (first + count) << (first + count);
    }
  }
}

void InterestReader::read_ranges(const Published& published) {
  if (!published.any[frame_ & 1]) {
    return;
  }
  if (published.publication->cells(frame_).size() < 4 * ranges_.size()) {
    return read_cells(published, [this](std::uint32_t cell) { return (wanted_[cell / 64] >> cell % 64 & 1) != 0; });
  }
  published.publication->read_rows(
      frame_, ranges_.size(), [this](std::size_t i) { return std::pair(ranges_[i].first, ranges_[i].last); },
      [this](std::span<const PublishedState> states) { add(states); });
}

// Chooses the cheaper of two ways. If the publication has states in many cells, it reads each row of the box, because
// the states of a row of cells are contiguous. If it has states in few cells, it tests each of these cells.
void InterestReader::read_box(const Published& published, const CellBox& box) {
  const std::size_t parity = frame_ & 1;
  if (!published.any[parity]) {
    return;
  }
  const CellBox& cell_range = published.cell_range[parity];
  CellBox common;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    common.lower[axis] = std::max(box.lower[axis], cell_range.lower[axis]);
    common.upper[axis] = std::min(box.upper[axis], cell_range.upper[axis]);
    if (common.lower[axis] > common.upper[axis]) {
      return;
    }
  }
  const std::size_t rows =
      std::size_t{common.upper[1] - common.lower[1] + 1u} * (common.upper[2] - common.lower[2] + 1u);
  if (published.publication->cells(frame_).size() < 4 * rows) {
    const regions::CellGrid& grid = publications_.grid;
    read_cells(published, [&](std::uint32_t cell) { return common.contains(grid.box_of(cell)); });
  } else {
    read_rows(published, common);
  }
}

void InterestReader::read_rows(const Published& published, const CellBox& box) {
  const regions::CellGrid& grid = publications_.grid;
  const std::size_t wide = box.upper[1] - box.lower[1] + std::size_t{1};
  std::uint32_t y = box.lower[1];
  std::uint32_t z = box.lower[2];
  published.publication->read_rows(
      frame_, wide * (box.upper[2] - box.lower[2] + std::size_t{1}),
      [&](std::size_t) {
        const std::pair cells(grid.index(box.lower[0], y, z), grid.index(box.upper[0], y, z));
        const bool end = y == box.upper[1];
        y = end ? box.lower[1] : y + 1;
        z += end ? 1 : 0;
        return cells;
      },
      [this](std::span<const PublishedState> states) { add(states); });
}

template <class Wanted>
void InterestReader::read_cells(const Published& published, Wanted wanted) {
  const auto cells = published.publication->cells(frame_);
  const auto starts = published.publication->starts(frame_);
  const auto states = published.publication->states(frame_);
  for (std::size_t first = 0; first < cells.size(); ++first) {
    if (!wanted(cells[first])) {
      continue;
    }
    std::size_t end = first + 1;
    while (end < cells.size() && wanted(cells[end])) {
      ++end;
    }
    add(states.subspan(starts[first], starts[end] - starts[first]));
    first = end;
  }
}

}  // namespace ringfence::nodes
