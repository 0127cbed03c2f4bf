#pragma once

#include <cstddef>
#include <cstdint>

#include "base/prefetch.hpp"
#include "geometry/checked_support.hpp"
#include "queries/asked.hpp"
#include "queries/frame_part.hpp"
#include "queries/swept_frames.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

// The object of a box and its pose, as a query of a batch sees them. Objects of a FramePart stand; those of SweptFrames
// are seen at the time of the query, and are null if the box does not count then.

inline const FrameObject* object_at(const FramePart& part, const FrameMoment&, std::size_t,
                                    std::uint32_t box) noexcept {
  return &part.object(box);
}
inline const FrameObject* object_at(const SweptFrames& part, const FrameMoment& moment, std::size_t query,
                                    std::uint32_t box) noexcept {
  return part.object(box, moment.times[query]);
}

inline std::uint32_t group_at(const FramePart& part, const FrameMoment&, std::size_t, std::uint32_t box) noexcept {
  return part.group(box);
}
inline std::uint32_t group_at(const SweptFrames& part, const FrameMoment& moment, std::size_t query,
                              std::uint32_t box) noexcept {
  return part.group(box, moment.times[query]);
}

inline const Pose& pose_at(const FramePart& part, const FrameMoment&, std::size_t, std::uint32_t box) noexcept {
  return part.object(box).pose;
}
inline Pose pose_at(const SweptFrames& part, const FrameMoment& moment, std::size_t query, std::uint32_t box) noexcept {
  return part.pose(box, moment.times[query]);
}

/// Prefetches what these read. Precondition: prefetch_place() was called a while before.
inline void prefetch_at(const FramePart& part, const FrameMoment&, std::size_t, std::uint32_t box) noexcept {
  base::prefetch_object(part.object(box));
}
inline void prefetch_at(const SweptFrames& part, const FrameMoment& moment, std::size_t query,
                        std::uint32_t box) noexcept {
  part.prefetch_object(box, moment.times[query]);
}

/// The object of a box; null if it does not count or the filter leaves it out.
template <class Part>
inline const FrameObject* admitted_at(const Part& part, const FrameMoment& moment, std::size_t query, std::uint32_t box,
                                      const QueryFilter& filter) {
  const FrameObject* const object = object_at(part, moment, query, box);
  const auto group = [&] { return group_at(part, moment, query, box); };
  return object != nullptr && admits(filter, *object, group) ? object : nullptr;
}

/// Counts and does a test, which returns the limit from now on: `limit` if its support function fails.
template <class Test>
inline double guarded(QueryWork& work, double limit, const Test& test) {
  ++work.tests;
  try {
    return test();
  } catch (const geometry::SupportFailure&) {
    ++work.failed_supports;
    return limit;
  }
}

/// Tests the object of one box, which a filter may leave out: `test(object, pose, limit)`. Returns the limit from now
/// on.
template <class Part, class Test>
double test_object(const Part& part, const FrameMoment& moment, std::size_t query, std::uint32_t box,
                   const QueryFilter& filter, double limit, QueryWork& work, const Test& test) {
  const FrameObject* const object = admitted_at(part, moment, query, box, filter);
  if (object == nullptr) return limit;
  return guarded(work, limit, [&] { return test(*object, pose_at(part, moment, query, box), limit); });
}

}  // namespace ringfence::queries
