#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {

/// `count` pairs of a shape of kind `p` and one of kind `q`, about half in contact. The first shape is within 100 m of
/// `origin` (metres). Hulls have 4 to 100 vertices. The pairs share 60 shapes of kind `p` and 60 of kind `q`. The
/// result depends only on the arguments. Precondition: `p` and `q` are sphere, box, capsule or hull.
PairWorld ordinary_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                const Vec3d& origin = {});

/// The same with hard cases. The first shape is at `origin`. Shapes: needles, plates of one millimetre, grids, prisms
/// of many sides, tetrahedra, hulls that do not contain their origin, sizes that differ by a factor of up to 1000.
/// Placements: equal centres, nested, face on face, touching within rounding, parallel.
PairWorld degenerate_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                  const Vec3d& origin = {});

/// The contacts that `kernel` finds for `pairs`; PairContact::pair is the index into `pairs`. Pairs whose bounding
/// radii differ by more than a factor of 32 are computed in double and come last. Precondition: all pairs have the two
/// kinds of the kernel.
std::vector<narrow_phase::PairContact> run_kernel(const PairWorld& world,
                                                  std::span<const geometry::CandidatePair> pairs,
                                                  narrow_phase::Kernel kernel);

}  // namespace ringfence::narrow_phase_test
