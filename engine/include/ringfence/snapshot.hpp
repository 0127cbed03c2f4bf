#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "ringfence/query.hpp"

namespace ringfence {

namespace facade {
class PinnedFrames;
}  // namespace facade

/// One complete frame, which stays as it is while the World continues, with the history before it: it answers queries
/// about its objects.
///
///   const ringfence::Snapshot now = world.snapshot();
///   if (const ringfence::Hit hit = now.cast({.start = eye, .displacement = view})) shoot(hit.object);
///
/// A copy refers to the same frame. Threads: any number may query one snapshot and copies of it, also while the World
/// runs frames; each computes on its own. They wait for each other only while the first query about a frame of the
/// history builds its index. Copies may be made and destroyed on any thread. Lifetime: a snapshot may outlive its
/// World. It keeps the memory of its frames, and shapes that were removed are freed only after the snapshots of frames
/// that have them. So keep one for a few frames, not for minutes.
///
/// Memory: a thread that asks batches keeps what they need, 8 MB, until it ends; an index is allocated where it is
/// built; lists grow. Nothing else is allocated. Failure: std::bad_alloc from functions with lists. Each query is
/// checked on its own: what is wrong with it is in its answer, and the others are answered. Floating point: as in
/// World.
class Snapshot {
 public:
  /// Empty: it finds nothing, with Status::out_of_order.
  Snapshot() noexcept = default;

  /// Whether it has a frame.
  explicit operator bool() const noexcept { return frames_ != nullptr; }
  /// FrameReport::frame of its frame. Precondition: it has one.
  std::uint64_t frame() const noexcept;
  /// The oldest frame that queries can ask about: frame() less WorldConfig::history, or 0. Precondition as for frame().
  std::uint64_t oldest_frame() const noexcept;
  /// Number of objects that queries about its frame can find: all that are enabled; 0 if empty.
  std::size_t objects() const noexcept;

  // Batches. hits[i] answers queries[i]. Precondition: both spans have the same size. `work`, if not null, is increased
  // by the cost.
  /// The first hit of each ray. Of equal fractions the lowest object number counts.
  void cast(std::span<const RayQuery> queries, std::span<Hit> hits, QueryWork* work = nullptr) const noexcept;
  /// Whether each ray hits anything; cheaper than cast().
  void cast_any(std::span<const RayQuery> queries, std::span<AnyHit> hits, QueryWork* work = nullptr) const noexcept;
  /// The first hit of each ray with each object.
  void cast_all(std::span<const RayQuery> queries, HitLists& hits, QueryWork* work = nullptr) const;
  /// As cast() and cast_all(), for shapes.
  void sweep(std::span<const SweepQuery> queries, std::span<Hit> hits, QueryWork* work = nullptr) const noexcept;
  void sweep_all(std::span<const SweepQuery> queries, HitLists& hits, QueryWork* work = nullptr) const;
  /// The objects that each shape overlaps or touches.
  void overlap(std::span<const OverlapQuery> queries, HitLists& hits, QueryWork* work = nullptr) const;
  /// The nearest object to each point. Of equal distances the lowest object number counts.
  void nearest(std::span<const NearestQuery> queries, std::span<Hit> hits, QueryWork* work = nullptr) const noexcept;

  // One query.
  Hit cast(const RayQuery& query) const noexcept { return first(&Snapshot::cast, query); }
  AnyHit cast_any(const RayQuery& query) const noexcept {
    AnyHit hit;
    cast_any({&query, 1}, {&hit, 1});
    return hit;
  }
  Hit sweep(const SweepQuery& query) const noexcept { return first(&Snapshot::sweep, query); }
  Hit nearest(const NearestQuery& query) const noexcept { return first(&Snapshot::nearest, query); }

 private:
  friend class World;
  explicit Snapshot(std::shared_ptr<const facade::PinnedFrames> frames) noexcept : frames_(std::move(frames)) {}
  template <class Query>
  Hit first(void (Snapshot::*batch)(std::span<const Query>, std::span<Hit>, QueryWork*) const noexcept,
            const Query& query) const noexcept {
    Hit hit;
    (this->*batch)({&query, 1}, {&hit, 1}, nullptr);
    return hit;
  }

  std::shared_ptr<const facade::PinnedFrames> frames_;
};

}  // namespace ringfence
