#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/shape_view.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase {

/// Whether shapes at poses overlap or touch, for many pairs at once: the kernels of contacts decide, sorted by kinds.
/// The result of a pair is that of overlaps() in shape_query.hpp: it does not depend on the other pairs.
///
/// Threads: belongs to one. Memory: 300 KB once it is used, kept. Functions that add may throw std::bad_alloc.
class OverlapTests {
 public:
  /// Whether the kernels test this kind. Meshes and support functions are left to overlaps().
  static constexpr bool tests(ShapeKind kind) noexcept { return kind <= ShapeKind::hull; }
  /// Number of tests to add before run().
  static constexpr std::size_t most = 1024;

  /// Removes all tests.
  void clear() noexcept {
    bodies_.clear();
    pairs_.clear();
    query_ = 0;
  }
  /// The shape of the tests that follow. Body as in NarrowPhase; only pose and shape count.
  void set_query(const Pose& pose, ShapeNumber shape);
  /// Adds a test of that shape with an object. Precondition: size() < most, and tests() of both kinds.
  void add(const Pose& pose, ShapeNumber shape);
  std::size_t size() const noexcept { return pairs_.size(); }  ///< number of tests

  /// The results in the order of adding: 1 if the shapes overlap or touch. Valid until the next run. The tests are
  /// removed, but set_query() still applies.
  std::span<const std::uint8_t> run(const geometry::ShapeView& shapes);

 private:
  struct Pair {
    std::uint32_t query, object;  ///< index in bodies_
  };
  std::vector<Body> bodies_;
  std::vector<Pair> pairs_;
  std::uint32_t query_ = 0;  ///< index in bodies_
  std::vector<std::uint8_t> keys_;
  std::vector<std::uint8_t> results_;
};

}  // namespace ringfence::narrow_phase
