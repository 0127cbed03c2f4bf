#pragma once

#include <cstddef>
#include <cstdint>

#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {

/// `count` pairs, the first of kind `p` and the second a mesh: rocks, open bowls, terrain, boxes of triangles; sizes of
/// a crowd, about half in contact. The shapes are few and shared. No mesh has more than `most` triangles (at least 20).
PairWorld ordinary_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin = {},
                              int most = 720);

/// The same made to be hard: needles and slivers, coplanar triangles in one surface and in two, soup, single triangles,
/// a vertex or an edge on a face, the same mesh in the same place, sizes up to a thousandfold apart.
PairWorld degenerate_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin = {},
                                int most = 720);

/// A flat or wavy square of 2 n² triangles around the origin, `half` metres to each side; `height` is that of its
/// waves.
TriangleMesh terrain(int n, double half, double height);

/// The surface of a box as triangles, each side cut into n by n squares.
TriangleMesh box_surface(Vec3d half_extents, int n);

}  // namespace ringfence::narrow_phase_test
