#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_bench {

/// What the objects of one side of a crowd are: a kind and, for hulls, how many vertices; for meshes, how many edges of
/// triangles to an edge of the icosahedron that they are made of.
struct Side {
  ShapeKind kind = ShapeKind::sphere;
  int vertices = 0;

  int triangles() const { return kind == ShapeKind::mesh ? 20 * vertices * vertices : 0; }
  /// "sphere", "hull32", "mesh" (of 320 triangles, as in the paper's world), "mesh5120": the word in benchmark names.
  std::string name() const;
};

/// A crowd of objects of two kinds with the sizes of the paper's world, and its candidates of one of each: all pairs
/// whose tight bounds overlap, in the order of a sweep along x. About half of them are in contact.
struct Crowd {
  Side a, b;
  std::unique_ptr<geometry::ShapeTable> shapes;
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;
};

/// `objects` objects, evenly spread over a cube of which they fill six hundredths; 64 shapes a side.
Crowd make_crowd(const Side& a, const Side& b, std::size_t objects, std::uint64_t seed);

/// A crowd's bodies and candidates in one of a run of frames.
struct Frame {
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;
};

/// The crowd in `count` frames, the first as it stands: each object goes its own way, at up to 0.3 m a frame as the
/// objects of the paper's world do, and turns by 0.02 rad.
std::vector<Frame> make_frames(const Crowd& crowd, std::size_t count, std::uint64_t seed);

}  // namespace ringfence::narrow_phase_bench
