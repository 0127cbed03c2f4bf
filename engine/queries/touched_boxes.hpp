#pragma once

#include <cstddef>
#include <cstdint>

#include "base/flat_list.hpp"
#include "queries/box_tree.hpp"
#include "queries/tree_kernels.hpp"

namespace ringfence::queries {

/// Boxes with consecutive positions in the order of a tree: [first, end).
struct BoxRange {
  std::uint32_t first;
  std::uint32_t end;
};

/// Finds the boxes of a BoxTree that overlap or touch a box, as ranges in the order of the tree. No two ranges overlap
/// or touch.
///
/// Cost: 3 to 5 ns for each group of eight boxes that are compared. Threads: belongs to one. Memory: 5 bytes a box of
/// the largest tree, kept.
class TouchedBoxes {
 public:
  /// Finds the boxes that touch `box`, in metres from the tree's origin. Returns the number of ranges. May throw
  /// std::bad_alloc if the tree is larger than any before.
  std::size_t find(const BoxTree& tree, const TreeBox& box) {
    if (tree.size() > room_) [[unlikely]] {
      reserve(tree.size());
    }
    return kernels_.list_touched(tree, box, {{groups_[0].data(), groups_[1].data()}, ends_.data()});
  }
  /// A range that the last find() has found.
  BoxRange operator[](std::size_t i) const noexcept { return {ends_[2 * i], ends_[2 * i + 1]}; }

 private:
  void reserve(std::size_t boxes);

  TreeKernels kernels_ = choose_tree_kernels();
  std::size_t room_ = 0;
  base::FlatList<std::uint32_t> groups_[2], ends_;
};

}  // namespace ringfence::queries
