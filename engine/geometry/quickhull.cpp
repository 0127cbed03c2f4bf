#include "geometry/quickhull.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>
#include <tuple>

#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

__extension__ using Wide = __int128;

/// Half the extent becomes 2^30. Then differences fit into 32 bits, minors into 64, determinants into 97.
constexpr double grid_half = 1073741824.0;
/// A point nearer to a face's plane than this is not added as a vertex: 2 * 10^-7 of the extent.
constexpr double slack = 2e-7 * 2 * grid_half;
/// Point sets thinner than this are flat: 2 * 10^-6 of the extent.
constexpr double flat = 2e-6 * 2 * grid_half;

struct Point {
  std::int64_t x, y, z;
  auto key() const { return std::tie(x, y, z); }
};

Point operator-(Point p, Point q) { return {p.x - q.x, p.y - q.y, p.z - q.z}; }
Vec3d real(Point p) { return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)}; }

/// Whether `eye` lies strictly on the outer side of the plane of a, b, c. Exact.
bool sees(Point a, Point b, Point c, Point eye) {
  const Point u = b - a, v = c - a, w = eye - a;
  const Wide nx = Wide{u.y} * v.z - Wide{u.z} * v.y;
  const Wide ny = Wide{u.z} * v.x - Wide{u.x} * v.z;
  const Wide nz = Wide{u.x} * v.y - Wide{u.y} * v.x;
  return nx * w.x + ny * w.y + nz * w.z > 0;
}

struct Face {
  std::uint32_t corner[3];
  std::uint32_t across[3];
  Vec3d normal;  ///< outward unit normal
  double offset;
  std::vector<std::uint32_t>
      outside;  ///< points outside the plane by more than the slack; each point is in one face's list
  bool alive = true;
  bool visible = false;
};

class Builder {
 public:
  explicit Builder(std::span<const Vec3f> points) {
    round_to_grid(points);
    start_with_tetrahedron();
    while (assign_all()) {
      // Faces are appended during this loop. A removed face has an empty list.
      for (std::uint32_t f = 0; f < faces_.size(); ++f) {
        while (faces_[f].alive && !faces_[f].outside.empty()) add_farthest_of(f);
      }
    }
  }

  std::vector<HullTriangle> triangles() const {
    std::vector<std::uint32_t> renumbered(faces_.size());
    std::uint32_t alive = 0;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      if (faces_[f].alive) renumbered[f] = alive++;
    }
    std::vector<HullTriangle> result;
    result.reserve(alive);
    for (const Face& face : faces_) {
      if (!face.alive) continue;
      HullTriangle triangle;
      for (int i = 0; i < 3; ++i) {
        triangle.corner[i] = source_[face.corner[i]];
        triangle.across[i] = renumbered[face.across[i]];
      }
      result.push_back(triangle);
    }
    return result;
  }

 private:
  void round_to_grid(std::span<const Vec3f> points) {
    if (points.empty()) throw Error("convex hull: no points; at least 4 that are not in a plane are needed");
    Vec3d low = to_double(points[0]), high = low;
    for (const Vec3f& point : points) {
      const Vec3d p = to_double(point);
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3d centre = (low + high) * 0.5;
    const Vec3d size = high - low;
    const double half = 0.5 * std::max({size.x, size.y, size.z});
    const double scale = half > 0 ? grid_half / half : 1.0;
    std::vector<Point> grid(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3d p = (to_double(points[i]) - centre) * scale;
      grid[i] = {std::llround(p.x), std::llround(p.y), std::llround(p.z)};
    }
    std::vector<std::uint32_t> order(points.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t j) {
      return grid[i].key() != grid[j].key() ? grid[i].key() < grid[j].key() : i < j;
    });
    for (const std::uint32_t i : order) {
      if (!points_.empty() && points_.back().key() == grid[i].key()) continue;
      points_.push_back(grid[i]);
      source_.push_back(i);
    }
    if (points_.size() < 4) {
      throw Error("convex hull: " + std::to_string(points_.size()) + " distinct points; at least 4 are needed");
    }
    settled_.assign(points_.size(), false);
  }

  template <class Measure>
  std::uint32_t greatest(Measure measure) const {
    std::uint32_t best = 0;
    double largest = measure(points_[0]);
    for (std::uint32_t i = 1; i < points_.size(); ++i) {
      const double value = measure(points_[i]);
      if (value > largest) best = i, largest = value;
    }
    return best;
  }

  void start_with_tetrahedron() {
    const std::array<std::uint32_t, 6> extreme{
        greatest([](Point p) { return real(p).x; }), greatest([](Point p) { return -real(p).x; }),
        greatest([](Point p) { return real(p).y; }), greatest([](Point p) { return -real(p).y; }),
        greatest([](Point p) { return real(p).z; }), greatest([](Point p) { return -real(p).z; })};
    std::uint32_t a = 0, b = 0;
    double widest = -1;
    for (const std::uint32_t i : extreme) {
      for (const std::uint32_t j : extreme) {
        const double distance = length(real(points_[i] - points_[j]));
        if (distance > widest) widest = distance, a = i, b = j;
      }
    }
    const Vec3d line = real(points_[b] - points_[a]) * (1 / widest);
    const auto from_line = [&](Point p) { return length(cross(real(p - points_[a]), line)); };
    const std::uint32_t c = greatest(from_line);
    const Vec3d across = cross(line, real(points_[c] - points_[a]));
    const double area = length(across);
    const Vec3d normal = across * (area > 0 ? 1 / area : 0.0);
    const auto from_plane = [&](Point p) { return std::abs(dot(normal, real(p - points_[a]))); };
    const std::uint32_t d = greatest(from_plane);
    if (!(from_line(points_[c]) > flat) || !(from_plane(points_[d]) > flat)) {
      throw Error("convex hull: all points lie in a plane (within 2e-6 of their extent); give it some thickness");
    }
    std::array<std::uint32_t, 4> t{a, b, c, d};
    if (sees(points_[a], points_[b], points_[c], points_[d])) std::swap(t[0], t[1]);
    // Face i does not contain corner 3 - i; across_of[i][e] is the face on the other side of edge e.
    const std::uint32_t corners[4][3] = {
        {t[0], t[1], t[2]}, {t[0], t[3], t[1]}, {t[0], t[2], t[3]}, {t[1], t[3], t[2]}};
    const std::uint32_t across_of[4][3] = {{1, 3, 2}, {2, 3, 0}, {0, 3, 1}, {1, 2, 0}};
    for (int f = 0; f < 4; ++f) {
      const std::uint32_t index = new_face(corners[f][0], corners[f][1], corners[f][2]);
      for (int e = 0; e < 3; ++e) faces_[index].across[e] = across_of[f][e];
    }
    for (const std::uint32_t i : t) settled_[i] = true;
  }

  std::uint32_t new_face(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    Face face{};
    face.alive = true;
    face.corner[0] = a, face.corner[1] = b, face.corner[2] = c;
    const Vec3d normal = cross(real(points_[b] - points_[a]), real(points_[c] - points_[a]));
    const double size = length(normal);
    assert(size > 0);
    face.normal = normal * (1 / size);
    face.offset = dot(face.normal, real(points_[a]));
    faces_.push_back(std::move(face));
    return static_cast<std::uint32_t>(faces_.size() - 1);
  }

  double beyond(const Face& face, std::uint32_t point) const {
    return dot(face.normal, real(points_[point])) - face.offset;
  }

  bool assign(std::uint32_t point, std::uint32_t first_face) {
    double largest = slack;
    std::uint32_t best = first_face;
    bool found = false;
    for (std::uint32_t f = first_face; f < faces_.size(); ++f) {
      if (!faces_[f].alive) continue;
      const double distance = beyond(faces_[f], point);
      if (distance > largest) largest = distance, best = f, found = true;
    }
    if (found) faces_[best].outside.push_back(point);
    return found;
  }

  /// Assigns every point that is still outside to a face's list. A point may have left the lists too early: the face
  /// that replaced its own came within the slack, but a neighbour did not. So this repeats until no point is left.
  bool assign_all() {
    bool any = false;
    for (std::uint32_t p = 0; p < points_.size(); ++p) {
      if (!settled_[p] && assign(p, 0)) any = true;
    }
    return any;
  }

  void add_farthest_of(std::uint32_t f) {
    std::vector<std::uint32_t>& list = faces_[f].outside;
    std::size_t farthest = 0;
    double largest = -1;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const double distance = beyond(faces_[f], list[i]);
      if (distance > largest) largest = distance, farthest = i;
    }
    const std::uint32_t eye = list[farthest];
    list.erase(list.begin() + static_cast<std::ptrdiff_t>(farthest));
    settled_[eye] = true;
    if (visible_from(eye, f)) add(eye, f);
  }

  bool visible_from(std::uint32_t eye, std::uint32_t f) const {
    const Face& face = faces_[f];
    return sees(points_[face.corner[0]], points_[face.corner[1]], points_[face.corner[2]], points_[eye]);
  }

  struct HorizonEdge {
    std::uint32_t from, to;
    std::uint32_t face;  ///< the face beyond the edge, which remains
  };

  /// Replaces the faces that `eye` sees by a fan of triangles around it. Visibility is exact, so the visible faces form
  /// one disc.
  void add(std::uint32_t eye, std::uint32_t first) {
    visible_.assign(1, first);
    faces_[first].visible = true;
    horizon_.clear();
    for (std::size_t i = 0; i < visible_.size(); ++i) {
      const std::uint32_t f = visible_[i];
      for (int e = 0; e < 3; ++e) {
        const std::uint32_t next = faces_[f].across[e];
        if (faces_[next].visible) continue;
        if (visible_from(eye, next)) {
          faces_[next].visible = true;
          visible_.push_back(next);
        } else {
          horizon_.push_back({faces_[f].corner[e], faces_[f].corner[(e + 1) % 3], next});
        }
      }
    }
    const auto first_new = static_cast<std::uint32_t>(faces_.size());
    fan_of_.resize(points_.size());
    for (const HorizonEdge& edge : horizon_) {
      const std::uint32_t f = new_face(edge.from, edge.to, eye);
      faces_[f].across[0] = edge.face;
      Face& neighbour = faces_[edge.face];
      for (int e = 0; e < 3; ++e) {
        if (neighbour.corner[e] == edge.to && neighbour.corner[(e + 1) % 3] == edge.from) neighbour.across[e] = f;
      }
      fan_of_[edge.from] = f;
    }
    for (std::uint32_t f = first_new; f < faces_.size(); ++f) {
      const std::uint32_t next = fan_of_[faces_[f].corner[1]];
      faces_[f].across[1] = next;
      faces_[next].across[2] = f;
    }
    for (const std::uint32_t f : visible_) {
      faces_[f].alive = false;
      const std::vector<std::uint32_t> orphans = std::move(faces_[f].outside);
      faces_[f].outside.clear();
      for (const std::uint32_t p : orphans) assign(p, first_new);
    }
  }

  std::vector<Point> points_;          // distinct, in lexicographic order
  std::vector<std::uint32_t> source_;  // index of each point in the input
  std::vector<bool> settled_;          // whether the point is a vertex or was found to be inside
  std::vector<Face> faces_;
  std::vector<std::uint32_t> visible_, fan_of_;
  std::vector<HorizonEdge> horizon_;
};

}  // namespace

std::vector<HullTriangle> quickhull(std::span<const Vec3f> points) { return Builder(points).triangles(); }

}  // namespace ringfence::geometry
