#pragma once

#include <vector>

#include "queries/searcher.hpp"

namespace ringfence::queries_test {

/// Collects the lists of a batch.
struct Lists final : queries::ListSink {
  explicit Lists(std::size_t queries) : of(queries) {}
  void add(std::uint32_t query, std::span<const queries::ObjectHit> hits) override {
    of[query].assign(hits.begin(), hits.end());
  }
  std::vector<std::vector<queries::ObjectHit>> of;
};

/// Asks one ray.
template <class Part>
void cast_one(const Part& part, const queries::FrameMoment& moment, const narrow_phase::Ray& ray,
              queries::ObjectHit& best, QueryWork& work) {
  queries::Searcher searcher;
  const queries::AskedRay asked{ray, {}};
  searcher.cast(part, moment, {&asked, 1}, {&best, 1}, work);
}

/// Asks for the nearest object.
template <class Part>
void find_one(const Part& part, const queries::FrameMoment& moment, const Vec3d& point, double distance,
              queries::ObjectPoint& best, QueryWork& work) {
  queries::Searcher searcher;
  const queries::AskedPoint asked{point, distance, {}};
  searcher.nearest(part, moment, {&asked, 1}, {&best, 1}, work);
}

}  // namespace ringfence::queries_test
