#include "reference/convex_surface.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "reference/exact.hpp"

namespace ringfence::reference {
namespace {

/// The index of the point for which `measure` is largest.
template <class Measure>
std::size_t farthest(std::span<const Vector> points, Measure measure) {
  std::size_t best = 0;
  double largest = -1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double value = measure(points[i]);
    if (value > largest) largest = value, best = i;
  }
  return best;
}

/// Four of the points that are not in one plane; nothing if all points are in one plane. The four are far apart, unless
/// all points are in one plane within rounding.
std::optional<std::array<Vector, 4>> simplex_of(std::span<const Vector> points) {
  if (points.size() < 4) return std::nullopt;
  const Vector a = points[0];
  const Vector b = points[farthest(points, [&](const Vector& p) { return length(p - a); })];
  const Vector c = points[farthest(points, [&](const Vector& p) { return length(triangle_normal(a, b, p)); })];
  const Vector normal = triangle_normal(a, b, c);
  Vector d = points[farthest(points, [&](const Vector& p) { return std::abs(dot(normal, p - a)); })];
  if (orientation(a, b, c, d) == 0) {
    const auto off =
        std::find_if(points.begin(), points.end(), [&](const Vector& p) { return orientation(a, b, c, p) != 0; });
    if (off == points.end()) return std::nullopt;
    d = *off;
  }
  return std::array{a, b, c, d};
}

constexpr std::uint64_t directed(std::uint32_t from, std::uint32_t to) { return std::uint64_t{from} << 32 | to; }

}  // namespace

std::optional<ConvexSurface> ConvexSurface::around(std::span<const Vector> points) {
  const auto simplex = simplex_of(points);
  if (!simplex) return std::nullopt;
  ConvexSurface out;
  out.points_.assign(simplex->begin(), simplex->end());
  if (orientation((*simplex)[0], (*simplex)[1], (*simplex)[2], (*simplex)[3]) > 0) {
    std::swap(out.points_[1], out.points_[2]);
  }
  out.add_face(0, 1, 2);
  out.add_face(0, 3, 1);
  out.add_face(1, 3, 2);
  out.add_face(2, 3, 0);
  for (const Vector& p : points) out.add(p);
  return out;
}

bool ConvexSurface::add(const Vector& point) {
  edges_.clear();
  std::size_t kept = 0;
  for (const Face& face : faces_) {
    const auto [i, j, k] = face.vertices;
    if (orientation(points_[i], points_[j], points_[k], point) > 0) {
      edges_.insert(edges_.end(), {directed(i, j), directed(j, k), directed(k, i)});
    } else {
      faces_[kept++] = face;
    }
  }
  if (edges_.empty()) return false;
  faces_.resize(kept);

  const auto apex = static_cast<std::uint32_t>(points_.size());
  points_.push_back(point);
  std::sort(edges_.begin(), edges_.end());
  for (const std::uint64_t edge : edges_) {
    const auto from = static_cast<std::uint32_t>(edge >> 32), to = static_cast<std::uint32_t>(edge);
    // The horizon is the border of the faces that the point sees: each of its edges belongs to one such face. The new
    // face is never degenerate: a point collinear with the edge would lie in the plane of that visible face.
    if (!std::binary_search(edges_.begin(), edges_.end(), directed(to, from))) add_face(from, to, apex);
  }
  return true;
}

void ConvexSurface::add_face(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
  Face face{{i, j, k}, triangle_normal(points_[i], points_[j], points_[k]), 0};
  const double area = length(face.normal);
  if (area > 0) face.normal = face.normal * (1 / area);
  face.offset = area > 0 ? dot(face.normal, points_[i]) : std::numeric_limits<double>::infinity();
  faces_.push_back(face);
}

}  // namespace ringfence::reference
