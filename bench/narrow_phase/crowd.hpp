#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_bench {

/// The objects of one side of a crowd: their kind; `vertices` is the number of vertices of a hull or, for a mesh, the
/// number of triangle edges per edge of the icosahedron from which it is made.
struct Side {
  ShapeKind kind = ShapeKind::sphere;
  int vertices = 0;
  bool lies = false;  ///< hulls with the corners of boxes, each of which lies on another

  int triangles() const { return kind == ShapeKind::mesh ? 20 * vertices * vertices : 0; }
  /// The name in benchmark names: "sphere", "hull32", "crate" (lies), "mesh" (320 triangles, as in the paper's world),
  /// "mesh5120".
  std::string name() const;
};

/// Objects of two kinds with the sizes of the paper's world, and the candidate pairs with one object of each kind: all
/// pairs whose tight bounds overlap, in the order of a sweep along x. About half of them are in contact.
struct Crowd {
  Side a, b;
  std::unique_ptr<geometry::ShapeTable> shapes;
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;
};

/// `objects` objects, distributed evenly over a cube of which they fill 6 %; 64 shapes per side.
Crowd make_crowd(const Side& a, const Side& b, std::size_t objects, std::uint64_t seed);

/// Pairs of hulls with the corners of boxes: the upper one lies on the lower one, turned about the vertical axis, and
/// overlaps it by up to 2 cm. Their faces are parallel, as those of objects at rest often are.
Crowd make_crates(const Side& side, std::size_t pairs, std::uint64_t seed);

/// Bodies and candidates of a crowd in one frame.
struct Frame {
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;
};

/// `count` frames of the crowd, starting from its current poses: each object moves by up to 0.3 m per frame, as in the
/// paper's world, and rotates by 0.02 rad.
std::vector<Frame> make_frames(const Crowd& crowd, std::size_t count, std::uint64_t seed);

}  // namespace ringfence::narrow_phase_bench
