#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "geometry/shape_table.hpp"
#include "queries/box_tree.hpp"
#include "queries/frame_object.hpp"
#include "queries/tree_order.hpp"

namespace ringfence::queries {

/// Objects of one frame with an index of their bounds; a Searcher answers queries about them.
///
/// A frame may be divided into parts in any way. The first hit of all parts is the least by (fraction, number).
///
/// Threads: build() by one thread; then all const functions by any number of threads. Memory: kept between builds, so
/// that builds allocate only when they need more than any before; some of it by the thread that builds. Refers to the
/// rows.
class FramePart {
 public:
  /// Replaces the contents by the `count` objects of `rows`; rows with the number 0 have none. Refers to the rows,
  /// which must stay as they are. Poses as in narrow_phase::Body. `hint`: share_order() of a part with about the same
  /// objects in the same rows, or null; answers do not depend on it.
  void build(std::span<const FrameObject> rows, std::size_t count, const geometry::ShapeTable& shapes,
             const KnownBounds& known = {}, std::shared_ptr<const TreeOrder> hint = nullptr);

  /// The same in the order of the build before as long as that is good and was not shared: for a part that is built in
  /// each frame.
  void build_again(std::span<const FrameObject> rows, std::size_t count, const geometry::ShapeTable& shapes,
                   const KnownBounds& known);

  /// The order of the tree, as a hint for other parts; null if the objects should be sorted. From the thread that
  /// builds.
  std::shared_ptr<const TreeOrder> share_order() noexcept;

  std::size_t size() const noexcept { return tree_.size(); }  ///< number of objects
  /// The objects' bounds, widened by what exact tests allow. The positions of its order are those of object().
  const BoxTree& tree() const noexcept { return tree_; }
  /// An object, by its position in the order of the tree.
  const FrameObject& object(std::uint32_t box) const noexcept { return rows_[order_->rows[box]]; }
  /// Prefetches what object() reads of the index; then object() can be prefetched without waiting.
  void prefetch_place(std::uint32_t box) const noexcept { base::prefetch_for_read(&order_->rows[box]); }

 private:
  bool build_in(const TreeOrder& order, std::size_t count, const KnownBounds& known);
  void finish(bool adapted, const geometry::ShapeTable& shapes, const KnownBounds& known);
  void sort();
  bool is_good() const noexcept;
  void find_bounds(const geometry::ShapeTable& shapes);
  void find_bounds(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, RowBounds* out);

  std::span<const FrameObject> rows_;
  std::shared_ptr<const TreeOrder> order_;
  std::shared_ptr<TreeOrder> own_, spare_;  ///< for sorting; their memory is used again unless it is shared
  bool is_shared_ = false;
  BoxTree tree_;
};

}  // namespace ringfence::queries
