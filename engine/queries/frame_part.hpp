#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/shape_table.hpp"
#include "narrow_phase/query/shape_query.hpp"
#include "queries/box_tree.hpp"
#include "queries/frame_object.hpp"
#include "queries/tree_kernels.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

/// The first hit of one object, and the object.
struct ObjectHit {
  const FrameObject* object = nullptr;  ///< null: nothing is hit
  narrow_phase::ShapeHit hit;
};

/// The nearest point of one object, and the object.
struct ObjectPoint {
  const FrameObject* object = nullptr;  ///< null: no object is within the distance
  narrow_phase::NearestPoint nearest;
};

/// A time at which queries see the objects, and their shapes.
struct FrameMoment {
  const geometry::ShapeView& shapes;
  double fraction = 0;  ///< of the way of each object, 0 to 1; see interpolate()
};

/// Objects of one frame with an index of their bounds; answers queries about them.
///
/// The answer to a query depends on the query and on the set of objects, not on their order, on the form of the index
/// or on the machine: the index only leaves out objects that the query cannot reach, and the exact tests are pure. A
/// frame may be divided into parts in any way. The first hit of all parts is the least by (fraction, number).
///
/// Threads: build() by one thread; then all const functions by any number of threads. Memory: kept between builds, so
/// that builds allocate only when they need more than any before; refers to the rows. Failure: an object whose support
/// function fails is not in the answer; QueryWork counts it.
class FramePart {
 public:
  FramePart();

  /// Replaces the contents by the objects of `rows`; those with the number 0 are left out. Refers to the rows, which
  /// must stay as they are. Poses as in narrow_phase::Body. `ends`: where each row's object is on its way to at
  /// FrameMoment::fraction 1, copied; empty: they stand.
  void build(std::span<const FrameObject> rows, std::span<const Pose> ends, const geometry::ShapeTable& shapes);

  std::size_t size() const noexcept { return tree_.size(); }  ///< number of objects

  /// Replaces `best` if an object is hit at a smaller fraction (at most 1), or at the same fraction and its number is
  /// smaller.
  void cast(const FrameMoment& moment, const narrow_phase::Ray& ray, const QueryFilter& filter, ObjectHit& best,
            QueryWork& work) const;
  /// Whether an object is hit.
  bool cast_any(const FrameMoment& moment, const narrow_phase::Ray& ray, const QueryFilter& filter,
                QueryWork& work) const;
  /// Appends the first hit of each object that is hit, in any order.
  void cast_all(const FrameMoment& moment, const narrow_phase::Ray& ray, const QueryFilter& filter,
                std::vector<ObjectHit>& hits, QueryWork& work) const;
  /// The same for a convex shape that moves along `path`.
  void sweep(const FrameMoment& moment, const narrow_phase::QueryShape& moving, const narrow_phase::Ray& path,
             const QueryFilter& filter, ObjectHit& best, QueryWork& work) const;
  void sweep_all(const FrameMoment& moment, const narrow_phase::QueryShape& moving, const narrow_phase::Ray& path,
                 const QueryFilter& filter, std::vector<ObjectHit>& hits, QueryWork& work) const;
  /// Appends every object that the shape at `position` overlaps or touches, in any order; of the hit only `triangle` is
  /// set.
  void overlap(const FrameMoment& moment, const narrow_phase::QueryShape& query, const Vec3d& position,
               const QueryFilter& filter, std::vector<ObjectHit>& hits, QueryWork& work) const;
  /// Replaces `best` if an object is nearer to `point`, or as near and its number is smaller. `limit`: metres, may be
  /// infinite.
  void nearest(const FrameMoment& moment, const Vec3d& point, double limit, const QueryFilter& filter,
               ObjectPoint& best, QueryWork& work) const;

 private:
  struct Asked;
  template <class Test>
  void search(const Asked& asked, const Reach& reach, double limit, QueryWork& work, const Test& test,
              bool by_distance = false) const;
  void find_bounds(const geometry::ShapeTable& shapes);
  Pose pose_of(std::size_t object, double fraction) const noexcept;

  TreeKernels kernels_;
  std::span<const FrameObject> rows_;
  std::vector<std::uint32_t> objects_;  ///< the rows that have one
  std::vector<std::uint32_t> row_of_;   ///< the same in the order of the tree
  std::vector<Pose> ends_;              ///< parallel to rows_, or empty
  std::vector<geometry::Bounds> bounds_;
  std::vector<float> margins_;  ///< metres
  BoxTree tree_;
};

}  // namespace ringfence::queries
