#include "reference/core.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "reference/convex_surface.hpp"
#include "reference/exact.hpp"

namespace ringfence::reference {
namespace {

void finish(Core& core) {
  core.offsets.clear();
  for (const Vector& n : core.normals) core.offsets.push_back(core.extent(n));
  core.reach = 0;
  for (const Vector& v : core.vertices) core.reach = std::max(core.reach, length(v));
}

/// Groups the triangles of a surface by plane: the triangles of one flat face share a number.
class FlatFaces {
 public:
  explicit FlatFaces(std::size_t triangles) : parent_(triangles) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) const {
    while (parent_[i] != i) i = parent_[i];
    return i;
  }
  void join(std::uint32_t i, std::uint32_t j) { parent_[find(i)] = find(j); }

 private:
  std::vector<std::uint32_t> parent_;
};

struct SurfaceEdge {
  std::uint32_t from, to;     // points
  std::uint32_t left, right;  // triangles
};

std::vector<SurfaceEdge> edges_of(std::span<const ConvexSurface::Face> faces) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> triangle_of;
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    for (int i = 0; i < 3; ++i) triangle_of[{faces[f].vertices[i], faces[f].vertices[(i + 1) % 3]}] = f;
  }
  std::vector<SurfaceEdge> out;
  for (const auto& [edge, left] : triangle_of) {
    if (edge.first < edge.second) {
      out.push_back({edge.first, edge.second, left, triangle_of.at({edge.second, edge.first})});
    }
  }
  return out;
}

bool coplanar(std::span<const Vector> points, const ConvexSurface::Face& p, const ConvexSurface::Face& q) {
  const auto* v = p.vertices;
  return std::all_of(q.vertices, q.vertices + 3, [&](std::uint32_t w) {
    return orientation(points[v[0]], points[v[1]], points[v[2]], points[w]) == 0;
  });
}

}  // namespace

double Core::extent(const Vector& direction) const {
  if (function) return dot(direction, support(direction));
  // Four maxima in parallel, so that they do not wait for each other.
  constexpr double least = -std::numeric_limits<double>::infinity();
  double largest[4] = {least, least, least, least};
  std::size_t i = 0;
  for (; i + 4 <= vertices.size(); i += 4) {
    for (std::size_t k = 0; k < 4; ++k) largest[k] = std::max(largest[k], dot(direction, vertices[i + k]));
  }
  for (; i < vertices.size(); ++i) largest[0] = std::max(largest[0], dot(direction, vertices[i]));
  return std::max(std::max(largest[0], largest[1]), std::max(largest[2], largest[3]));
}

Vector Core::support(const Vector& direction) const {
  if (function) {
    const Vector d = normalised(direction);
    return Vector(function->support({static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)}));
  }
  std::size_t best = 0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double value = dot(direction, vertices[i]);
    if (value > largest) largest = value, best = i;
  }
  return vertices[best];
}

Core box_core(const Vector& half_extents) {
  const double h[3] = {half_extents.x, half_extents.y, half_extents.z};
  const auto corner = [&](int bits) {
    return Vector{bits & 1 ? h[0] : -h[0], bits & 2 ? h[1] : -h[1], bits & 4 ? h[2] : -h[2]};
  };
  // Coinciding corners keep the number of the first; bit i of `wide` is set where corners differ on axis i.
  const int wide = (h[0] > 0 ? 1 : 0) | (h[1] > 0 ? 2 : 0) | (h[2] > 0 ? 4 : 0);
  std::uint32_t number[8] = {};
  Core core;
  for (int c = 0; c < 8; ++c) {
    if (c & ~wide) {
      number[c] = number[c & wide];
    } else {
      number[c] = static_cast<std::uint32_t>(core.vertices.size());
      core.vertices.push_back(corner(c));
    }
  }
  core.flat = wide != 7;
  const Vector axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vector& axis : axes) core.normals.insert(core.normals.end(), {axis, -axis});  // faces 2 i and 2 i + 1
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    for (int side = 0; side < 4; ++side) {
      const int low = (side & 1 ? 1 << j : 0) | (side & 2 ? 1 << k : 0);
      core.arcs.push_back({axes[i],
                           corner(low),
                           {static_cast<std::uint32_t>(2 * j + (side & 1 ? 0 : 1)),
                            static_cast<std::uint32_t>(2 * k + (side & 2 ? 0 : 1))},
                           h[i] > 0});
      const bool distinct = (low & ~wide) == 0;
      if (distinct && (wide & 1 << i)) core.segments.push_back({number[low], number[low | 1 << i]});
    }
    const int across = 1 << j | 1 << k;
    if ((wide & across) != across) continue;
    for (int side = 0; side < (wide & 1 << i ? 2 : 1); ++side) {
      const int low = side << i;
      const std::uint32_t p = number[low], q = number[low | across];
      core.triangles.push_back({p, number[low | 1 << j], q});
      core.triangles.push_back({p, number[low | 1 << k], q});
    }
  }
  finish(core);
  return core;
}

Core hull_core(std::span<const Vec3f> points) {
  std::vector<Vector> all;
  for (const Vec3f& p : points) all.emplace_back(p);
  const auto surface = ConvexSurface::around(all);
  if (!surface) throw std::invalid_argument("hull: all points lie in one plane");
  const auto faces = surface->faces();
  const auto edges = edges_of(faces);

  FlatFaces flat(faces.size());
  for (const SurfaceEdge& e : edges) {
    if (coplanar(surface->points(), faces[e.left], faces[e.right])) flat.join(e.left, e.right);
  }

  Core core;
  std::map<std::uint32_t, std::uint32_t> vertex_of;  // from points of the surface to vertices of the core
  for (const auto& face : faces) {
    for (const std::uint32_t v : face.vertices) {
      if (vertex_of.emplace(v, static_cast<std::uint32_t>(core.vertices.size())).second) {
        core.vertices.push_back(surface->points()[v]);
      }
    }
    core.triangles.push_back(
        {vertex_of.at(face.vertices[0]), vertex_of.at(face.vertices[1]), vertex_of.at(face.vertices[2])});
  }

  // The triangle of largest area in a flat face has the most precise normal.
  std::map<std::uint32_t, std::pair<double, Vector>> widest;
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    const auto* v = faces[f].vertices;
    const double area =
        length(triangle_normal(surface->points()[v[0]], surface->points()[v[1]], surface->points()[v[2]]));
    auto& best = widest[flat.find(f)];
    if (area >= best.first) best = {area, faces[f].normal};
  }
  std::map<std::uint32_t, std::uint32_t> normal_of;
  for (const auto& [face, best] : widest) {
    normal_of[face] = static_cast<std::uint32_t>(core.normals.size());
    core.normals.push_back(best.second);
  }

  for (const SurfaceEdge& e : edges) {
    if (flat.find(e.left) == flat.find(e.right)) continue;
    const std::uint32_t from = vertex_of.at(e.from), to = vertex_of.at(e.to);
    core.segments.push_back({from, to});
    core.arcs.push_back({normalised(core.vertices[to] - core.vertices[from]),
                         core.vertices[from],
                         {normal_of.at(flat.find(e.left)), normal_of.at(flat.find(e.right))},
                         true});
  }
  finish(core);
  return core;
}

Core function_core(std::shared_ptr<const SupportFunction> function) {
  Core core;
  core.function = std::move(function);
  // A ball that holds the corners of the box around the shape holds the shape.
  double squared = 0;
  for (const Vector& axis : {Vector{1, 0, 0}, Vector{0, 1, 0}, Vector{0, 0, 1}}) {
    const double half = std::max(std::abs(core.extent(axis)), std::abs(core.extent(-axis)));
    squared += half * half;
  }
  core.reach = std::sqrt(squared);
  return core;
}

void set_triangle(Core& core, const Vector& a, const Vector& b, const Vector& c) {
  const Vector up = normalised(triangle_normal(a, b, c));
  core.vertices.assign({a, b, c});
  core.normals.assign({up, -up});
  core.arcs.clear();
  core.segments.assign({{0, 1}, {1, 2}, {2, 0}});
  core.triangles.assign({{0, 1, 2}});
  // A prism of zero height: faces 0 and 1 are its ends, face 2 + i is its side along edge i, whose outward normal lies
  // in the plane of the triangle.
  for (std::uint32_t i = 0; i < 3; ++i) {
    const Vector from = core.vertices[i], along = normalised(core.vertices[(i + 1) % 3] - from);
    core.normals.push_back(normalised(cross(along, up)));
    core.arcs.push_back({along, from, {0, 2 + i}, true});
    core.arcs.push_back({along, from, {1, 2 + i}, true});
    core.arcs.push_back({up, from, {2 + i, 2 + (i + 2) % 3}, false});
  }
  core.function.reset();
  core.flat = true;
  core.radius = 0;
  finish(core);
}

Core core_of(const ShapeDescription& shape) {
  struct Visitor {
    Core operator()(const Sphere& s) const {
      Core core = box_core({});
      core.radius = s.radius;
      return core;
    }
    Core operator()(const Box& s) const { return box_core(Vector(s.half_extents)); }
    Core operator()(const Capsule& s) const {
      Core core = box_core({0, 0, s.half_height});
      core.radius = s.radius;
      return core;
    }
    Core operator()(const ConvexHull& s) const { return hull_core(s.points); }
    Core operator()(const TriangleMesh&) const { throw std::invalid_argument("a triangle mesh has no core"); }
    Core operator()(const SupportShape& s) const { return function_core(s.function); }
  };
  return std::visit(Visitor{}, shape);
}

}  // namespace ringfence::reference
