#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "narrow_phase/query/overlap_tests.hpp"
#include "narrow_phase/query/ray/placed_rays.hpp"
#include "narrow_phase/query/shape_hit.hpp"
#include "queries/asked.hpp"
#include "queries/block_search.hpp"
#include "queries/frame_part.hpp"
#include "queries/swept_frames.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

/// The first hit of one object, and the object.
struct ObjectHit {
  const FrameObject* object = nullptr;  ///< null: nothing is hit
  narrow_phase::ShapeHit hit;
};

/// The nearest point of one object, and the object.
struct ObjectPoint {
  const FrameObject* object = nullptr;  ///< null: no object is within the distance
  narrow_phase::NearestPoint nearest;
};

/// Receives the lists of a batch.
class ListSink {
 public:
  virtual ~ListSink() = default;
  /// All that query number `query` finds, in any order; at least one hit. Calls are ascending by query, and a query
  /// that finds nothing has none. The hits live during the call. May throw std::bad_alloc.
  virtual void add(std::uint32_t query, std::span<const ObjectHit> hits) = 0;
};

/// Answers batches of queries about the objects of a `Part`: of a FramePart or of SweptFrames.
///
/// The answer to a query depends on the query and on the set of objects, not on the other queries, on the order of the
/// objects, on the form of the index or on the machine: the index only leaves out objects that the query cannot reach,
/// and the exact tests are pure.
///
/// Threads: belongs to one. Memory: that of BlockSearch. Failure: std::bad_alloc from functions with lists. An object
/// whose support function fails is not in the answer; QueryWork counts it.
class Searcher {
 public:
  // found[i] answers asked[i].

  /// Replaces what is in `found` where an object is hit at a smaller fraction (at most 1), or at the same fraction and
  /// its number is smaller.
  template <class Part>
  void cast(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked, std::span<ObjectHit> found,
            QueryWork& work) noexcept;
  template <class Part>
  void sweep(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked, std::span<ObjectHit> found,
             QueryWork& work) noexcept;
  /// Whether an object is hit.
  template <class Part>
  void cast_any(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked, std::span<bool> found,
                QueryWork& work) noexcept;
  /// Replaces what is in `found` where an object is nearer, or as near and its number is smaller.
  template <class Part>
  void nearest(const Part& part, const FrameMoment& moment, std::span<const AskedPoint> asked,
               std::span<ObjectPoint> found, QueryWork& work) noexcept;

  // Lists.

  /// The first hit of each object that is hit.
  template <class Part>
  void cast_all(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked, ListSink& found,
                QueryWork& work);
  template <class Part>
  void sweep_all(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked, ListSink& found,
                 QueryWork& work);
  /// Every object that a shape at the start of its path overlaps or touches; of the hit only `triangle` is set.
  template <class Part>
  void overlap(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked, ListSink& found,
               QueryWork& work);

 private:
  template <class Part, class Asked>
  void find_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::span<ObjectHit> found,
                  QueryWork& work);
  template <class Part, class Asked>
  void find_all(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, ListSink& found,
                QueryWork& work);
  void start_lists() noexcept;
  void list(std::uint32_t query, const ObjectHit& hit, ListSink& found);
  void finish_list(ListSink& found);
  void list_overlaps(const geometry::ShapeView& shapes, ListSink& found);

  BlockSearch search_;
  narrow_phase::PlacedRays placed_;
  /// A pair in overlap_tests_.
  struct Tested {
    std::uint32_t query;
    const FrameObject* object;
  };
  std::vector<ObjectHit> list_;  ///< of query listed_query_, not complete yet
  std::uint32_t listed_query_ = 0;
  narrow_phase::OverlapTests overlap_tests_;
  std::vector<Tested> tested_;
};

}  // namespace ringfence::queries
