#include "nodes/server/contacts/border_matches.hpp"

#include <algorithm>
#include <bit>

namespace ringfence::nodes {

bool BorderMatches::prepare() {
  if (endings_.empty()) {
    return false;
  }
  const std::size_t places = std::bit_ceil(2 * endings_.size());
  shift_ = 64 - static_cast<unsigned>(std::countr_zero(places));
  table_.resize(places);
  std::fill(table_.begin(), table_.end(), std::uint64_t{0});
  for (const std::uint64_t key : endings_) {
    table_[place_of(key)] = key;
  }
  return true;
}

void BorderMatches::match(NodeNumber node, std::span<const BorderContact> beginnings) {
  for (const BorderContact& beginning : beginnings) {
    if (table_[place_of(beginning.key)] == beginning.key) {
      matches_.push_back({node, beginning.position});
      passed_.push_back(beginning.key);
    }
  }
}

void BorderMatches::finish() {
  std::sort(passed_.begin(), passed_.end());
  passed_.resize(static_cast<std::size_t>(std::unique(passed_.begin(), passed_.end()) - passed_.begin()));
}

// The place of a key, or the free one where it would be.
std::size_t BorderMatches::place_of(std::uint64_t key) const noexcept {
  const std::size_t mask = table_.size() - 1;
  auto at = static_cast<std::size_t>(key * std::uint64_t{0x9e3779b97f4a7c15u} >> shift_);
  while (table_[at] != key && table_[at] != 0) {
    at = (at + 1) & mask;
  }
  return at;
}

}  // namespace ringfence::nodes
