#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/number_index.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::facade {

/// Index from objects to their contacts in the last frame. Built once per frame, at the first query.
///
/// Threads: belongs to the thread that calls World. update() allocates when it builds the index.
class ContactIndex {
 public:
  /// Indexes the contacts of the last frame unless it has done so. `frames` is the number of complete frames, not 0.
  void update(std::uint64_t frames, std::span<const Contact> contacts);
  /// Indices of the object's contacts in the span that was indexed, ascending. Precondition: number is not 0.
  std::span<const std::uint32_t> of(ObjectNumber number) const noexcept;

 private:
  void build(std::span<const Contact> contacts);

  std::uint64_t frames_ = 0;  ///< of the last update()
  base::NumberIndex objects_;
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> ends_;
};

}  // namespace ringfence::facade
