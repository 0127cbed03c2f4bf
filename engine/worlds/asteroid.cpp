#include "worlds/asteroid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "geometry/vector.hpp"
#include "motion/random.hpp"
#include "ringfence/error.hpp"

namespace ringfence::worlds {
namespace {

using motion::Draws;

constexpr std::uint32_t stream = 111;
constexpr int bumps = 12;

/// Identifies a vertex of the subdivided icosahedron: the icosahedron vertices it is interpolated from and their
/// weights, sorted by vertex. Faces that share a vertex compute the same key, so the mesh stores it once.
using Key = std::array<std::pair<std::uint32_t, std::uint32_t>, 3>;

Vec3d direction_of(const Key& key, const std::array<Vec3d, 12>& vertices) {
  Vec3d sum{};
  for (const auto& [vertex, weight] : key) sum = sum + vertices[vertex] * static_cast<double>(weight);
  return sum * (1 / length(sum));
}

std::array<Vec3d, 12> icosahedron() {
  const double golden = (1 + std::sqrt(5.0)) / 2;
  std::array<Vec3d, 12> out;
  std::size_t count = 0;
  for (const double p : {-1.0, 1.0}) {
    for (const double q : {-golden, golden}) {
      out[count++] = {0, p, q};
      out[count++] = {p, q, 0};
      out[count++] = {q, 0, p};
    }
  }
  return out;
}

/// The 20 faces: all triples of mutually adjacent vertices, wound anticlockwise seen from outside.
std::vector<std::array<std::uint32_t, 3>> faces_of(const std::array<Vec3d, 12>& vertices) {
  std::vector<std::array<std::uint32_t, 3>> out;
  const auto neighbours = [&](std::uint32_t p, std::uint32_t q) { return length(vertices[p] - vertices[q]) < 2.1; };
  for (std::uint32_t p = 0; p < 12; ++p) {
    for (std::uint32_t q = p + 1; q < 12; ++q) {
      for (std::uint32_t r = q + 1; r < 12; ++r) {
        if (!neighbours(p, q) || !neighbours(q, r) || !neighbours(p, r)) continue;
        const bool outwards = dot(vertices[p], cross(vertices[q], vertices[r])) > 0;
        out.push_back(outwards ? std::array{p, q, r} : std::array{p, r, q});
      }
    }
  }
  return out;
}

/// A smooth displacement of the surface around one direction.
struct Bump {
  Vec3d centre;
  double height;  ///< metres at the centre; negative: a crater
  double width;   ///< cosine of the angle to the centre at which the displacement ends
};

/// The surface of one asteroid: a sphere with bumps, scaled on each axis.
class Relief {
 public:
  Relief(std::uint64_t seed, std::uint32_t index) {
    Draws draws(seed, stream, index);
    for (Bump& bump : bumps_) {
      bump.centre = random_unit_vector(draws);
      bump.height = double{draws.between(-0.15f, 0.2f)};
      bump.width = double{draws.between(0.3f, 0.9f)};
    }
    const double x = double{draws.between(0.6f, 1.2f)}, y = double{draws.between(0.6f, 1.2f)};
    scale_ = {x, y, double{draws.between(0.6f, 1.2f)}};
  }

  /// The surface point in a unit `direction`.
  Vec3f surface_point(Vec3d direction) const {
    double radius = 1;
    for (const Bump& bump : bumps_) {
      const double within = (dot(direction, bump.centre) - bump.width) / (1 - bump.width);
      if (within > 0) radius += bump.height * within * within * (3 - 2 * within);
    }
    radius = std::max(radius, 0.4);
    return to_float(
        {direction.x * radius * scale_.x, direction.y * radius * scale_.y, direction.z * radius * scale_.z});
  }

 private:
  static Vec3d random_unit_vector(Draws& draws) {
    for (;;) {
      const double x = double{draws.between(-1, 1)}, y = double{draws.between(-1, 1)}, z = double{draws.between(-1, 1)};
      const double squared = x * x + y * y + z * z;
      if (squared <= 1 && squared > 0.01) return Vec3d{x, y, z} * (1 / std::sqrt(squared));
    }
  }

  std::array<Bump, bumps> bumps_;
  Vec3d scale_;
};

}  // namespace

TriangleMesh make_asteroid(std::uint64_t seed, std::uint32_t index, std::uint32_t frequency) {
  if (frequency < 1 || frequency > 223) throw Error("asteroid: frequency must be 1 to 223");
  const std::array<Vec3d, 12> base = icosahedron();
  const Relief relief(seed, index);
  TriangleMesh mesh;
  std::map<Key, std::uint32_t> numbers;
  for (const auto& face : faces_of(base)) {
    const auto vertex = [&](std::uint32_t i, std::uint32_t j) {
      Key key{{{face[0], frequency - i - j}, {face[1], i}, {face[2], j}}};
      // A vertex of weight 0 does not contribute. Clear its number, so that both faces of an edge compute one key.
      for (auto& part : key) {
        if (part.second == 0) part.first = 0;
      }
      std::sort(key.begin(), key.end());
      const auto [at, fresh] = numbers.emplace(key, static_cast<std::uint32_t>(mesh.vertices.size()));
      if (fresh) mesh.vertices.push_back(relief.surface_point(direction_of(key, base)));
      return at->second;
    };
    for (std::uint32_t i = 0; i < frequency; ++i) {
      for (std::uint32_t j = 0; i + j < frequency; ++j) {
        const std::uint32_t p = vertex(i, j), q = vertex(i + 1, j), r = vertex(i, j + 1);
        mesh.indices.insert(mesh.indices.end(), {p, q, r});
        if (i + j + 1 < frequency) mesh.indices.insert(mesh.indices.end(), {q, vertex(i + 1, j + 1), r});
      }
    }
  }
  return mesh;
}

double volume_inside(const TriangleMesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const Vec3d p = to_double(mesh.vertices[mesh.indices[i]]), q = to_double(mesh.vertices[mesh.indices[i + 1]]),
                r = to_double(mesh.vertices[mesh.indices[i + 2]]);
    sum += dot(p, cross(q, r));
  }
  return sum / 6;
}

}  // namespace ringfence::worlds
