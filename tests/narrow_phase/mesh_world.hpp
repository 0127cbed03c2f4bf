#pragma once

#include <cstddef>
#include <cstdint>

#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {

/// `count` pairs, the first of kind `p` and the second a mesh: rocks, open bowls, terrain, boxes of triangles; ordinary
/// sizes, about half in contact. The shapes are few and shared. No mesh has more than `most` triangles (at least 20).
PairWorld ordinary_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin = {},
                              int most = 720);

/// The same with hard cases: needles and slivers, coplanar triangles in one surface and in two, triangle soup, single
/// triangles, a vertex or an edge on a face, the same mesh at the same position, sizes that differ by a factor of up to
/// 1000.
PairWorld degenerate_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin = {},
                                int most = 720);

/// A flat or wavy square of 2 n² triangles around the origin, with sides of 2 `half` metres; `height` is the amplitude
/// of the waves.
TriangleMesh terrain(int n, double half, double height);

/// The surface of a box as triangles, each side divided into n by n squares.
TriangleMesh box_surface(Vec3d half_extents, int n);

}  // namespace ringfence::narrow_phase_test
