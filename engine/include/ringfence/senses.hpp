#pragma once

#include <span>

#include "ringfence/ids.hpp"
#include "ringfence/query.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

/// The list of hits of a query that a motion model asks.
struct SensedHits {
  Status status = Status::ok;  ///< as in Hit
  /// In order of number. Valid until the next query of the same call of MotionModel::move.
  std::span<const Hit> hits;
};

/// What one object senses of its surroundings: queries about the frame before the one that is being computed, S(k-1) of
/// all objects, within WorldConfig::sense metres of its own position MotionInput::pose. MotionInput::senses points to
/// it.
///
/// The answers are those of a Snapshot of frame k-1, bit for bit, in every deployment, at any number of nodes, and in
/// every process. So a model that senses stays pure. The object itself is found too; QueryFilter::except with self()
/// leaves it out.
///
/// Refused with Status::beyond_sense: a query that reaches farther. The start and the end of a ray, and the shape's
/// bounding ball (about its origin) at the start and at the end of a sweep, or where it overlaps, must lie within the
/// distance. The nearest object is searched within NearestQuery::distance of the point, and this ball must lie within
/// the distance too. Refused with Status::frame_expired: QueryFrame with a number other than that of frame k-1. In the
/// first frame there is none before it, and every query is refused with Status::out_of_order. Everything else as for
/// Snapshot; what is wrong with a query is in its answer. Do not remove a shape with which a model may still ask.
///
/// Threads and lifetime: only in the call of MotionModel::move that received it. Failure: Status::out_of_memory.
/// Memory: a list grows to the longest so far; nothing else is allocated.
class Senses {
 public:
  virtual ~Senses() = default;

  /// The object that senses, for QueryFilter::except.
  virtual ObjectId self() const noexcept = 0;

  /// The first hit of a ray. Of equal fractions the lowest object number counts.
  virtual Hit cast(const RayQuery& query) const noexcept = 0;
  /// Whether a ray hits anything, such as a line of sight; cheaper than cast().
  virtual AnyHit cast_any(const RayQuery& query) const noexcept = 0;
  /// As cast(), for a shape.
  virtual Hit sweep(const SweepQuery& query) const noexcept = 0;
  /// The objects that a shape overlaps or touches.
  virtual SensedHits overlap(const OverlapQuery& query) const noexcept = 0;
  /// The nearest object to a point. Of equal distances the lowest object number counts.
  virtual Hit nearest(const NearestQuery& query) const noexcept = 0;
};

}  // namespace ringfence
