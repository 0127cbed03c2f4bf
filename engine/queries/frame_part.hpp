#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/frame_stamp.hpp"
#include "base/prefetch.hpp"
#include "geometry/shape_table.hpp"
#include "queries/box_tree.hpp"
#include "queries/frame_object.hpp"
#include "queries/tree_order.hpp"

namespace ringfence::queries {

/// Bounds of objects that are known before an index is built, by row; empty: none is known.
struct KnownBounds {
  std::span<const RowBounds> rows{};
  const BoxConverter* box_of = nullptr;  ///< converts them
  /// By row: the last frame in which the object has changed.
  std::span<const base::FrameStamp> changed{};
  /// The frame that the same FramePart was built for before, with the same box_of, if it was.
  std::optional<base::FrameStamp> built{};
  bool same_rows = false;  ///< each key has the row that it had then
};

/// Objects of one frame with an index of their bounds; a Searcher answers queries about them.
///
/// A frame may be divided into parts in any way. The first hit of all parts is the least by (fraction, number).
///
/// Threads: build() by one thread; then all const functions by any number of threads. Memory: kept between builds, so
/// that builds allocate only when they need more than any before; some of it by the thread that builds. Refers to the
/// rows.
class FramePart {
 public:
  /// Replaces the contents. Refers to the rows, which must stay as they are. Poses as in narrow_phase::Body. `hint`:
  /// share_order() of a part with about the same objects, or null; answers do not depend on it.
  void build(const FrameRows& objects, const geometry::ShapeTable& shapes, const KnownBounds& known = {},
             std::shared_ptr<const TreeOrder> hint = nullptr);

  /// The same in the order of the build before as long as that is good and was not shared: for a part that is built in
  /// each frame.
  void build_again(const FrameRows& objects, const geometry::ShapeTable& shapes, const KnownBounds& known);

  /// The order of the tree, as a hint for other parts; null if the objects should be sorted. From the thread that
  /// builds.
  std::shared_ptr<const TreeOrder> share_order() noexcept;

  std::size_t size() const noexcept { return tree_.size(); }  ///< number of objects
  /// The objects' bounds, widened by what exact tests allow. The positions of its order are those of object().
  const BoxTree& tree() const noexcept { return tree_; }
  /// An object, by its position in the order of the tree.
  const FrameObject& object(std::uint32_t box) const noexcept { return objects_.rows[row_of_box_[box]]; }
  /// The row of such an object.
  std::size_t row(const FrameObject& object) const noexcept {
    return static_cast<std::size_t>(&object - objects_.rows.data());
  }
  std::uint32_t group(std::uint32_t box) const noexcept { return objects_.group(row_of_box_[box]); }
  /// Prefetches what object() reads of the index; then object() can be prefetched without waiting.
  void prefetch_place(std::uint32_t box) const noexcept { base::prefetch_for_read(&row_of_box_[box]); }

 private:
  bool build_in(const TreeOrder& order, const FrameRows& objects, const geometry::ShapeTable& shapes,
                const KnownBounds& known);
  bool find_rows(const TreeOrder& order, const FrameRows& objects);
  bool find_changed_rows(const TreeOrder& order, const FrameRows& objects, const KnownBounds& known,
                         std::vector<std::uint32_t>& groups);
  void find_changed_groups(const KnownBounds& known, std::vector<std::uint32_t>& groups) const;
  void build_own(bool adapted, const FrameRows& objects, const geometry::ShapeTable& shapes, const KnownBounds& known);
  void sort(const FrameRows& objects);
  bool is_good() const noexcept;
  void set_bounds(const geometry::ShapeTable& shapes);
  void find_bounds(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, RowBounds* out) const;

  FrameRows objects_;
  base::FlatList<std::uint32_t> row_of_box_;  ///< by position in the order
  std::shared_ptr<const TreeOrder> order_;
  std::shared_ptr<TreeOrder> own_, spare_;  ///< for sorting; their memory is used again unless it is shared
  bool is_shared_ = false;
  bool is_built_ = false;  ///< the tree is that of order_ and row_of_box_
  BoxTree tree_;
};

}  // namespace ringfence::queries
