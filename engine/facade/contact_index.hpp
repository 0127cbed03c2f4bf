#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/number_index.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::facade {

/// Index from objects to their contacts in one frame. Built once per frame, at the first query.
///
/// Threads: belongs to the thread that calls World. build() allocates.
class ContactIndex {
 public:
  /// Indexes the contacts of one frame, which must stay in place.
  void build(std::span<const Contact> contacts);
  /// Indices of the object's contacts, ascending.
  std::span<const std::uint32_t> of(ObjectNumber number) const noexcept;

 private:
  base::NumberIndex objects_;
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> ends_;
};

}  // namespace ringfence::facade
