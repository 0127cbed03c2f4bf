#include "nodes/exchange/user_index.hpp"

#include <algorithm>
#include <bit>

namespace ringfence::nodes {

namespace {

/// A publication with more cells than `few_cells` is read row by row by all user nodes, which is cheaper than an entry
/// for each cell, as long as there are few of them.
constexpr std::size_t few_cells = 8, most_wide = 64;

}  // namespace

bool UserIndexer::is_wide(const Published& published, std::size_t wide, std::uint64_t frame) const noexcept {
  return wide < most_wide && published.publication->cells(frame).size() > few_cells;
}

void UserIndexer::list(Publications& all, std::span<const UserNumber> users, std::uint64_t frame) {
  const std::size_t parity = frame & 1;
  UserIndex& index = all.user_index[parity];
  index.wide.clear();
  index.entries.clear();
  cells_.clear();
  for (const UserNumber user : users) {
    const Published& published = all.users[user];
    if (published.publication == nullptr || !published.any[parity]) {
      continue;
    }
    // Most users have states in one cell: then nothing but this entry is read.
    if (const regions::CellBox& box = published.cell_range[parity]; box.single()) {
      cells_.add(all.grid.index(box.lower[0], box.lower[1], box.lower[2]), user);
    } else if (is_wide(published, index.wide.size(), frame)) {
      index.wide.push_back(user);
    } else {
      for (const std::uint32_t cell : published.publication->cells(frame)) {
        cells_.add(cell, user);
      }
    }
  }
  cells_.sort();
  index.entries.reserve(cells_.size());
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    index.entries.push_back(cells_.key_at(i));
  }
  list_blocks(index, all.grid.cells());
}

void UserIndexer::list_blocks(UserIndex& index, std::size_t cells) const {
  const std::size_t blocks = std::min(cells, std::bit_ceil(std::max<std::size_t>(index.entries.size(), 1)));
  index.block_log2 = static_cast<unsigned>(std::countr_zero(cells) - std::countr_zero(blocks));
  index.block_starts.clear();
  index.block_starts.reserve(blocks + 1);
  std::size_t position = 0;
  for (std::size_t block = 0; block < blocks; ++block) {
    const auto is_before = [&](std::uint64_t entry) { return UserIndex::cell_of(entry) >> index.block_log2 < block; };
    while (position < index.entries.size() && is_before(index.entries[position])) {
      ++position;
    }
    index.block_starts.push_back(static_cast<std::uint32_t>(position));
  }
  index.block_starts.push_back(static_cast<std::uint32_t>(index.entries.size()));
}

}  // namespace ringfence::nodes
