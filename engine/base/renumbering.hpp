#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ringfence::base {

/// The positions of a list's entries after some of them were removed.
///
/// Asked for ascending positions it needs one pass over the removed ones.
class Renumbering {
 public:
  static constexpr std::uint32_t gone = ~std::uint32_t{0};

  /// `removed`: positions before the removal, ascending. They outlive the object.
  explicit Renumbering(std::span<const std::uint32_t> removed) noexcept : removed_(removed) {}

  /// The new position of the entry that was at `position`; `gone` if it was removed. Precondition: not below the
  /// position of the call before.
  std::uint32_t operator()(std::uint32_t position) noexcept {
    while (next_ < removed_.size() && removed_[next_] < position) {
      ++next_;
    }
    const bool is_gone = next_ < removed_.size() && removed_[next_] == position;
    return is_gone ? gone : position - static_cast<std::uint32_t>(next_);
  }

 private:
  std::span<const std::uint32_t> removed_;
  std::size_t next_ = 0;  ///< number of removed positions below the last one asked for
};

}  // namespace ringfence::base
