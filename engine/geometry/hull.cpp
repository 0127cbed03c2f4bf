#include "geometry/hull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>

#include "geometry/quickhull.hpp"
#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

/// Neighbouring triangles that are coplanar within this part of the extent form one face.
constexpr double flatness = 5e-7;

struct Facets {
  std::vector<std::uint32_t> of_triangle;
  std::uint32_t count = 0;
};

Vec3d area_vector(std::span<const Vec3f> points, const HullTriangle& t) {
  const Vec3d a = to_double(points[t.corner[0]]);
  return cross(to_double(points[t.corner[1]]) - a, to_double(points[t.corner[2]]) - a);
}

double extent_of(std::span<const Vec3f> points) {
  Vec3d low = to_double(points[0]), high = low;
  for (const Vec3f& point : points) {
    const Vec3d p = to_double(point);
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

/// Merges coplanar triangles into faces. Starts from the largest triangles, because their planes are the most accurate.
Facets merge_coplanar(std::span<const Vec3f> points, std::span<const HullTriangle> triangles) {
  const double tolerance = flatness * extent_of(points);
  std::vector<Vec3d> areas(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) areas[t] = area_vector(points, triangles[t]);
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t i, std::uint32_t j) { return dot(areas[i], areas[i]) > dot(areas[j], areas[j]); });
  constexpr std::uint32_t none = 0xffffffffu;
  Facets facets{std::vector<std::uint32_t>(triangles.size(), none), 0};
  std::vector<std::uint32_t> front;
  for (const std::uint32_t seed : order) {
    if (facets.of_triangle[seed] != none) continue;
    const Vec3d normal = areas[seed] * (1 / length(areas[seed]));
    const double offset = dot(normal, to_double(points[triangles[seed].corner[0]]));
    const auto in_plane = [&](const HullTriangle& t) {
      return std::all_of(std::begin(t.corner), std::end(t.corner), [&](std::uint32_t corner) {
        return std::abs(dot(normal, to_double(points[corner])) - offset) <= tolerance;
      });
    };
    front.assign(1, seed);
    facets.of_triangle[seed] = facets.count;
    while (!front.empty()) {
      const HullTriangle& t = triangles[front.back()];
      front.pop_back();
      for (const std::uint32_t next : t.across) {
        if (facets.of_triangle[next] == none && dot(areas[next], normal) > 0 && in_plane(triangles[next])) {
          facets.of_triangle[next] = facets.count;
          front.push_back(next);
        }
      }
    }
    ++facets.count;
  }
  return facets;
}

Facets one_face_per_triangle(std::size_t triangles) {
  Facets facets{std::vector<std::uint32_t>(triangles), static_cast<std::uint32_t>(triangles)};
  std::iota(facets.of_triangle.begin(), facets.of_triangle.end(), 0u);
  return facets;
}

/// Vertices where at least three faces meet. The other vertices lie inside a face or an edge.
std::vector<std::uint32_t> corners_of(std::span<const HullTriangle> triangles, const Facets& facets) {
  std::map<std::uint32_t, std::vector<std::uint32_t>> faces_of_vertex;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const std::uint32_t corner : triangles[t].corner) {
      std::vector<std::uint32_t>& faces = faces_of_vertex[corner];
      if (std::find(faces.begin(), faces.end(), facets.of_triangle[t]) == faces.end()) {
        faces.push_back(facets.of_triangle[t]);
      }
    }
  }
  std::vector<std::uint32_t> corners;
  for (const auto& [corner, faces] : faces_of_vertex) {
    if (faces.size() >= 3) corners.push_back(corner);
  }
  return corners;
}

std::size_t vertices_of(std::span<const HullTriangle> triangles) {
  return triangles.size() / 2 + 2;  // Euler's formula for a closed surface of triangles
}

}  // namespace

/// Builds the columns of a Hull from a closed surface of triangles and their assignment to faces.
class HullAssembly {
 public:
  /// Returns nothing if a face is not a simple polygon, which only rounding near the flatness limit can cause.
  static std::optional<Hull> assemble(std::span<const Vec3f> points, std::span<const HullTriangle> triangles,
                                      const Facets& facets) {
    HullAssembly assembly(points, triangles, facets);
    if (!assembly.trace_faces()) return std::nullopt;
    assembly.list_edges();
    const Hull& hull = assembly.hull_;
    if (hull.vertex_count_ + hull.face_count_ != hull.edges_.size() + 2) return std::nullopt;
    assembly.place_vertices();
    assembly.measure();
    assembly.place_planes();
    assembly.place_fixed_point_planes();
    assembly.place_edges();
    assembly.place_faces_of_edges();
    return std::move(assembly.hull_);
  }

 private:
  HullAssembly(std::span<const Vec3f> points, std::span<const HullTriangle> triangles, const Facets& facets)
      : points_(points), triangles_(triangles), facets_(facets), number_of_(points.size(), 0) {
    for (const HullTriangle& t : triangles) used_.insert(used_.end(), std::begin(t.corner), std::end(t.corner));
    std::sort(used_.begin(), used_.end());
    used_.erase(std::unique(used_.begin(), used_.end()), used_.end());
    for (std::size_t i = 0; i < used_.size(); ++i) number_of_[used_[i]] = static_cast<std::uint16_t>(i);
    hull_.vertex_count_ = used_.size();
    hull_.face_count_ = facets.count;
  }

  bool trace_faces() {
    constexpr std::uint32_t none = 0xffffffffu;
    std::vector<std::vector<std::array<std::uint32_t, 2>>> rims(facets_.count);
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (std::size_t e = 0; e < 3; ++e) {
        if (facets_.of_triangle[triangles_[t].across[e]] == facets_.of_triangle[t]) continue;
        rims[facets_.of_triangle[t]].push_back({triangles_[t].corner[e], triangles_[t].corner[(e + 1) % 3]});
      }
    }
    std::vector<std::uint32_t> next(points_.size(), none);
    hull_.face_starts_.assign(1, 0);
    for (const auto& rim : rims) {
      if (rim.size() < 3) return false;
      for (const auto& [from, to] : rim) {
        if (next[from] != none) return false;
        next[from] = to;
      }
      std::size_t visited = 0;
      for (std::uint32_t at = rim[0][0]; visited == 0 || at != rim[0][0]; at = next[at], ++visited) {
        hull_.face_vertices_.push_back(number_of_[at]);
      }
      if (visited != rim.size()) return false;
      for (const auto& edge : rim) next[edge[0]] = none;
      hull_.face_starts_.push_back(static_cast<std::uint32_t>(hull_.face_vertices_.size()));
    }
    return true;
  }

  void list_edges() {
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (std::size_t e = 0; e < 3; ++e) {
        const std::uint32_t from = triangles_[t].corner[e], to = triangles_[t].corner[(e + 1) % 3];
        const std::uint32_t left = facets_.of_triangle[t], right = facets_.of_triangle[triangles_[t].across[e]];
        if (left == right || from > to) continue;
        HullEdge& edge = hull_.edges_.emplace_back();
        edge.from = number_of_[from];
        edge.to = number_of_[to];
        edge.left = static_cast<std::uint16_t>(left);
        edge.right = static_cast<std::uint16_t>(right);
      }
    }
  }

  void place_vertices() {
    const std::size_t stride = padded(used_.size());
    hull_.vertices_.resize(3 * stride);
    for (std::size_t i = 0; i < stride; ++i) {
      const Vec3f p = points_[used_[i < used_.size() ? i : 0]];
      hull_.vertices_[i] = p.x;
      hull_.vertices_[stride + i] = p.y;
      hull_.vertices_[2 * stride + i] = p.z;
    }
  }

  void measure() {
    // Relative to a vertex: the origin may lie far outside, which would cancel most digits.
    const Vec3d base = to_double(points_[used_[0]]);
    double six_volumes = 0, radius_squared = 0;
    Vec3d moment;
    for (const HullTriangle& t : triangles_) {
      const Vec3d a = to_double(points_[t.corner[0]]) - base, b = to_double(points_[t.corner[1]]) - base,
                  c = to_double(points_[t.corner[2]]) - base;
      const double volume = dot(a, cross(b, c));
      six_volumes += volume;
      moment = moment + (a + b + c) * (volume / 4);
    }
    for (const std::uint32_t i : used_) {
      const Vec3d p = to_double(points_[i]);
      radius_squared = std::max(radius_squared, dot(p, p));
    }
    hull_.volume_ = six_volumes / 6;
    hull_.centroid_ = to_float(base + moment * (1 / six_volumes));
    hull_.bounding_radius_ = rounded_up(std::sqrt(radius_squared));
    double extent_squared = 0;
    for (const std::uint32_t i : used_) {
      const Vec3d p = to_double(points_[i]) - to_double(hull_.centroid_);
      extent_squared = std::max(extent_squared, dot(p, p));
    }
    hull_.extent_ = rounded_up(std::sqrt(extent_squared));
  }

  void place_planes() {
    std::vector<Vec3d> areas(facets_.count);
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      Vec3d& area = areas[facets_.of_triangle[t]];
      area = area + area_vector(points_, triangles_[t]);
    }
    const std::size_t stride = padded(facets_.count);
    hull_.faces_.resize(4 * stride);
    double inner = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < stride; ++i) {
      const Vec3d area = areas[i < facets_.count ? i : 0];
      const Vec3f normal = to_float(area * (1 / length(area)));
      double offset = -std::numeric_limits<double>::infinity();
      for (const std::uint32_t v : used_) offset = std::max(offset, dot(to_double(normal), to_double(points_[v])));
      hull_.faces_[i] = normal.x;
      hull_.faces_[stride + i] = normal.y;
      hull_.faces_[2 * stride + i] = normal.z;
      hull_.faces_[3 * stride + i] = rounded_up(offset);
      inner = std::min(inner, offset - dot(to_double(normal), to_double(hull_.centroid_)));
    }
    hull_.inner_radius_ = static_cast<float>(std::max(0.0, inner * (1 - 1e-6)));
  }

  void place_fixed_point_planes() {
    const std::size_t faces = hull_.face_count_, stride = padded_fixed_point(faces);
    const auto rounded = [](double value) {
      return static_cast<std::int16_t>(std::clamp(std::lround(value * 32768), -32767L, 32767L));
    };
    hull_.fixed_point_planes_.resize(4 * stride);
    for (std::size_t i = 0; i < stride; ++i) {
      const std::size_t face = i < faces ? i : 0;
      const Vec3d normal = to_double(hull_.normal(face));
      const double distance = hull_.offset()[face] - dot(normal, to_double(hull_.centroid_));
      const double values[4] = {normal.x, normal.y, normal.z, distance / hull_.extent_};
      std::int16_t* const group = &hull_.fixed_point_planes_[i / fixed_point_lanes * 4 * fixed_point_lanes];
      for (std::size_t k = 0; k < 4; ++k) group[k * fixed_point_lanes + i % fixed_point_lanes] = rounded(values[k]);
    }
  }

  void place_faces_of_edges() {
    if (hull_.face_count_ > 256) return;
    const std::size_t count = hull_.edges_.size();
    const std::size_t stride = (count + face_column_bytes - 1) / face_column_bytes * face_column_bytes;
    hull_.faces_of_edges_.assign(2 * stride, 0);
    for (std::size_t i = 0; i < count; ++i) {
      hull_.faces_of_edges_[i] = static_cast<std::uint8_t>(hull_.edges_[i].left);
      hull_.faces_of_edges_[stride + i] = static_cast<std::uint8_t>(hull_.edges_[i].right);
    }
  }

  void place_edges() {
    const std::size_t count = hull_.edges_.size(), stride = padded(count);
    hull_.edge_columns_.resize(edge_columns * stride);
    for (std::size_t i = 0; i < stride; ++i) {
      HullEdge& edge = hull_.edges_[i < count ? i : 0];
      const Vec3f left = hull_.normal(edge.left), right = hull_.normal(edge.right), from = hull_.vertex(edge.from);
      const Vec3d difference = to_double(hull_.vertex(edge.to)) - to_double(from);
      const Vec3f along = to_float(difference * (1 / length(difference)));
      edge.left_normal = left;
      edge.right_normal = right;
      edge.along = along;
      edge.from_x = from.x;
      edge.from_y = from.y;
      edge.from_z = from.z;
      edge.length = static_cast<float>(length(difference));
      const float values[edge_columns] = {left.x, left.y, left.z,  right.x, right.y, right.z,    from.x,
                                          from.y, from.z, along.x, along.y, along.z, edge.length};
      for (std::size_t c = 0; c < edge_columns; ++c) hull_.edge_columns_[c * stride + i] = values[c];
    }
    hull_.edge_ends_.reserve(count);
    for (const HullEdge& edge : hull_.edges_) {
      hull_.edge_ends_.push_back({static_cast<std::uint8_t>(edge.from), static_cast<std::uint8_t>(edge.to)});
    }
  }

  std::span<const Vec3f> points_;
  std::span<const HullTriangle> triangles_;
  const Facets& facets_;
  std::vector<std::uint32_t> used_;       // indices of the points that are vertices, ascending
  std::vector<std::uint16_t> number_of_;  // number of each point among the vertices
  Hull hull_;
};

Hull build_hull(std::span<const Vec3f> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_finite(points[i])) throw Error("convex hull: point " + std::to_string(i) + " is not finite");
  }
  std::vector<Vec3f> points_in_use(points.begin(), points.end());
  std::vector<HullTriangle> triangles = quickhull(points_in_use);
  Facets facets = merge_coplanar(points_in_use, triangles);
  // Remove the points inside a face or an edge and build the hull again from the others. One round is usual. Each round
  // removes points; after four rounds the vertices stay as they are.
  for (int round = 0; round < 4; ++round) {
    const std::vector<std::uint32_t> corners = corners_of(triangles, facets);
    if (corners.size() == vertices_of(triangles) || corners.size() < 4) break;
    std::vector<Vec3f> remaining;
    for (const std::uint32_t i : corners) remaining.push_back(points_in_use[i]);
    points_in_use = std::move(remaining);
    triangles = quickhull(points_in_use);
    facets = merge_coplanar(points_in_use, triangles);
  }
  if (vertices_of(triangles) > max_hull_vertices) {
    throw Error("convex hull: " + std::to_string(vertices_of(triangles)) + " vertices; at most " +
                std::to_string(max_hull_vertices) + " are allowed, give fewer points");
  }
  if (std::optional<Hull> hull = HullAssembly::assemble(points_in_use, triangles, facets)) return std::move(*hull);
  const Facets unmerged = one_face_per_triangle(triangles.size());
  std::optional<Hull> hull = HullAssembly::assemble(points_in_use, triangles, unmerged);
  if (!hull) throw Error("convex hull: the points lie too close to a plane");
  return std::move(*hull);
}

}  // namespace ringfence::geometry
