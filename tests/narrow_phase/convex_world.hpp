#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {

/// `count` pairs of a shape of kind `p` and one of kind `q`, about half in contact. Hulls have 4 to 64 vertices, some
/// more. The shapes are few and shared.
PairWorld ordinary_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                const Vec3d& origin = {});

/// The same with hard cases: needles, plates of one millimetre, grids, prisms of many sides, tetrahedra, hulls that do
/// not contain their origin, sizes that differ by a factor of up to 1000; coinciding centres, nested, face on face,
/// touching within rounding, parallel.
PairWorld degenerate_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                  const Vec3d& origin = {});

/// The results of `kernel` for `pairs` of the world, in the order of the pairs; in double where the sizes require it.
std::vector<narrow_phase::PairContact> run_kernel(const PairWorld& world,
                                                  std::span<const geometry::CandidatePair> pairs,
                                                  narrow_phase::Kernel kernel);

}  // namespace ringfence::narrow_phase_test
