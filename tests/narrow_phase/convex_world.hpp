#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {

/// `count` pairs of a shape of kind `p` and one of kind `q`, of which hulls have 4 to 64 vertices and a few more; about
/// half in contact. The shapes are few and shared.
PairWorld ordinary_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                const Vec3d& origin = {});

/// The same made to be hard: needles, plates of a millimetre, grids, prisms of many sides, tetrahedra, hulls that do
/// not hold their origin, sizes up to a thousandfold apart; the same centre, nested, face on face, touching to within
/// rounding, parallel.
PairWorld degenerate_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                  const Vec3d& origin = {});

/// What `kernel` answers for `pairs` of the world, in the order of the pairs; in double where the sizes ask for it.
std::vector<narrow_phase::PairContact> run_kernel(const PairWorld& world,
                                                  std::span<const geometry::CandidatePair> pairs,
                                                  narrow_phase::Kernel kernel);

}  // namespace ringfence::narrow_phase_test
