#pragma once

#include <cmath>
#include <limits>
#include <span>

#include "geometry/shape_view.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/shape_query.hpp"
#include "queries/box_tree.hpp"
#include "queries/swept_frames.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

// Queries of a batch, checked.

struct AskedRay {
  narrow_phase::Ray ray;
  QueryFilter filter;
};
/// A shape that moves along a path. An overlap has no displacement.
struct AskedShape {
  narrow_phase::QueryShape shape;
  narrow_phase::Ray path;
  QueryFilter filter;
};
struct AskedPoint {
  Vec3d point;
  double distance;  ///< metres, may be infinite
  QueryFilter filter;
};

/// When the queries of a batch see the objects, and the shapes that these have.
struct FrameMoment {
  const geometry::ShapeView& shapes;
  std::span<const QueryTime> times{};  ///< by query; of SweptFrames only
};

// What queries reach in a tree.

/// Radius of a ball around the origin of a query's shape that contains what exact tests find, metres.
inline double radius_of(const narrow_phase::QueryShape& shape) noexcept {
  const geometry::ShapeRow& row = shape.shapes.row(shape.shape);
  return double{row.bounding_radius} * (1 + double{tolerance_of(row.kind)});
}

inline Reach reach_of(const BoxTree& tree, const AskedRay& asked) noexcept {
  return tree.reach(asked.ray.start, asked.ray.start, asked.ray.displacement);
}
inline Reach reach_of(const BoxTree& tree, const AskedShape& asked) noexcept {
  const double radius = radius_of(asked.shape);
  const Vec3d ball{radius, radius, radius};
  return tree.reach(asked.path.start - ball, asked.path.start + ball, asked.path.displacement);
}

/// The boxes near a point, nearer than Reach::limit.
inline Reach reach_of(const BoxTree& tree, const AskedPoint& asked) noexcept {
  return tree.reach(asked.point, asked.point, {});
}

/// The boxes that the ball around the shape touches at its start: of a search near a point.
inline Reach near_reach_of(const BoxTree& tree, const AskedShape& asked) noexcept {
  Reach reach = tree.reach(asked.path.start, asked.path.start, {});
  reach.limit = std::nextafter(static_cast<float>(radius_of(asked.shape)), std::numeric_limits<float>::infinity());
  return reach;
}

}  // namespace ringfence::queries
