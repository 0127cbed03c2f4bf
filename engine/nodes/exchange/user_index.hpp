#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/pair_sort.hpp"
#include "nodes/exchange/publications.hpp"

namespace ringfence::nodes {

/// Fills UserIndex: which user nodes have published states in which cells, so that a user node finds those near it
/// without a look at the others.
///
/// Threads: belongs to the server role. Memory: 40 bytes an entry of the largest frame, kept.
class UserIndexer {
 public:
  /// Lists the publications of `users` in `all`, which have finished writing `frame`.
  void list(Publications& all, std::span<const UserNumber> users, std::uint64_t frame);

 private:
  /// `cells`: of the grid, a power of two.
  void list_blocks(UserIndex& index, std::size_t cells) const;
  bool is_wide(const Published& published, std::size_t wide, std::uint64_t frame) const noexcept;

  base::PairSort cells_;  ///< cell and user
};

}  // namespace ringfence::nodes
