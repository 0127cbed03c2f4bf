#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "narrow_phase/narrow_phase.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

/// What queries read of an object of a frame: one cache line.
using FrameObject = narrow_phase::Body;

/// The objects of a frame or of a part of it, in rows of any order. An object has a key, which it keeps from frame to
/// frame as long as it is there: in a frame of a World its slot. Its row may be another one in each frame. A row that
/// is not in `row_of` does not count.
struct FrameRows {
  static constexpr std::uint32_t none = 0xffffffffu;

  std::span<const FrameObject> rows;
  std::span<const std::uint32_t> row_of;    ///< by key; none: there is no object with that key
  std::size_t objects = 0;                  ///< number of keys with an object
  std::span<const std::uint32_t> groups{};  ///< by row; empty: no object has one
  /// By row, 1: the object was placed at its pose, and did not move there from the frame before. Empty: none was.
  std::span<const std::uint8_t> jumped{};

  /// The row of a key, or none.
  std::uint32_t row(std::uint32_t key) const noexcept { return key < row_of.size() ? row_of[key] : none; }
  std::uint32_t group(std::size_t row) const noexcept { return groups.empty() ? 0 : groups[row]; }
  bool has_jumped(std::size_t row) const noexcept { return !jumped.empty() && jumped[row] != 0; }
};

/// Whether a query with that filter may find the object; `group()` is called only if the filter depends on it.
template <class Group>
bool admits(const QueryFilter& filter, const FrameObject& object, const Group& group) {
  return (filter.layers >> object.layer & 1) != 0 && (filter.categories >> object.category & 1) != 0 &&
         (object.number != filter.except.number() || object.generation != filter.except.generation()) &&
         (filter.except_group == 0 || group() != filter.except_group);
}

}  // namespace ringfence::queries
