#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "ringfence/snapshot.hpp"
#include "ringfence/world.hpp"
#include "worlds/query_file.hpp"

namespace ringfence::tools {

/// The answers to the queries of one frame, in batches of one kind. Meant to be used again. One thread.
class FrameAnswers {
 public:
  /// Answers `rows`, which are about the last frame of `world`. Shapes have the numbers that they have in the scene, as
  /// worlds::load_into registers them. Throws IncompleteError that names a query which the world refuses.
  void answer(const World& world, std::span<const worlds::QueryRow> rows);

  /// The hits of rows[row], in the order of HitLists. ray_any: one hit without an object, or none.
  std::span<const Hit> hits(std::size_t row) const noexcept {
    return {hits_.data() + places_[row].begin, places_[row].count};
  }
  std::size_t hit_count() const noexcept { return hits_.size(); }
  /// What the last call cost.
  const QueryWork& work() const noexcept { return work_; }
  /// Wall time that the last call spent in World::snapshot() and in the batches, ms.
  double ms() const noexcept { return ms_; }

 private:
  /// Queries of one kind, the indices of their rows, and what answers them.
  template <class Query, class Answers>
  struct Batch {
    std::vector<Query> queries;
    std::vector<std::size_t> rows;
    Answers answers;
  };
  struct Place {
    std::size_t begin = 0, count = 0;
  };

  void sort_into_batches(const World& world, std::span<const worlds::QueryRow> rows);
  void add_row(const World& world, const worlds::QueryRow& row, std::size_t index);
  void run_batches(const World& world);
  void collect(std::span<const worlds::QueryRow> rows);
  template <class Visit>
  void each_batch(const Visit& visit);
  template <class Query>
  void place_hits(std::span<const worlds::QueryRow> rows, const Batch<Query, std::vector<Hit>>& batch);
  template <class Query>
  void place_hits(std::span<const worlds::QueryRow> rows, const Batch<Query, std::vector<AnyHit>>& batch);
  template <class Query>
  void place_hits(std::span<const worlds::QueryRow> rows, const Batch<Query, HitLists>& batch);

  Batch<RayQuery, std::vector<Hit>> rays_;
  Batch<RayQuery, std::vector<AnyHit>> any_rays_;
  Batch<RayQuery, HitLists> all_rays_;
  Batch<SweepQuery, std::vector<Hit>> sweeps_;
  Batch<SweepQuery, HitLists> all_sweeps_;
  Batch<OverlapQuery, HitLists> overlaps_;
  Batch<NearestQuery, std::vector<Hit>> nearest_;
  std::vector<Hit> hits_;
  std::vector<Place> places_;  ///< in hits_, by row
  QueryWork work_;
  double ms_ = 0;
};

}  // namespace ringfence::tools
