#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "nodes/host/hosted_objects.hpp"
#include "queries/recorded_frame.hpp"
#include "queries/searcher.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/senses.hpp"

namespace ringfence::nodes {

/// Answers the queries that the motion model asks in the move of one host (ringfence/senses.hpp).
///
/// The frame before has all objects that queries within the distance can find; others do not change an answer. So the
/// answers are the same whether a host has all objects of the world or only those near its own.
///
/// Threads: belongs to the host; the frame is only read. Memory: one entry for each object of a batch, and a list.
class HostSenses {
 public:
  /// `distance`: WorldConfig::sense, metres, above 0.
  explicit HostSenses(double distance) noexcept : distance_(distance) {}
  HostSenses(const HostSenses&) = delete;
  HostSenses& operator=(const HostSenses&) = delete;

  /// The frame before the next move, which stays as it is until that has ended; null if there is none.
  void set_frame(const queries::RecordedFrame* frame) noexcept { frame_ = frame; }
  /// Gives the inputs of a batch of hosted objects their senses, until the next call. May throw std::bad_alloc.
  void give(std::span<MotionInput> inputs, std::span<const Hosted> objects);

 private:
  /// What one object senses.
  class Around final : public Senses {
   public:
    Around(HostSenses& senses, ObjectId object, const Vec3d& position) noexcept
        : senses_(&senses), object_(object), position_(position) {}
    ObjectId self() const noexcept override { return object_; }
    Hit cast(const RayQuery& query) const noexcept override;
    AnyHit cast_any(const RayQuery& query) const noexcept override;
    Hit sweep(const SweepQuery& query) const noexcept override;
    SensedHits overlap(const OverlapQuery& query) const noexcept override;
    Hit nearest(const NearestQuery& query) const noexcept override;

   private:
    template <class Asked, class Query>
    Status check(const Query& query, Asked& asked) const noexcept;
    template <class Asked, class Found, class Query, class Search>
    Hit first(const Query& query, Search search) const noexcept;
    double reach_of(const RayQuery& query) const noexcept;
    double reach_of(const SweepQuery& query) const noexcept;
    double reach_of(const OverlapQuery& query) const noexcept;
    double reach_of(const NearestQuery& query) const noexcept;

    HostSenses* senses_;
    ObjectId object_;
    Vec3d position_;
  };

  const double distance_;
  const queries::RecordedFrame* frame_ = nullptr;
  queries::Searcher searcher_;
  std::vector<Hit> list_;  ///< of the last overlap
  std::vector<Around> around_;
};

}  // namespace ringfence::nodes
