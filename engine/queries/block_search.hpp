#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <new>
#include <span>

#include "base/flat_list.hpp"
#include "narrow_phase/query/ray/placed_rays.hpp"
#include "queries/asked.hpp"
#include "queries/reached_boxes.hpp"
#include "queries/test_object.hpp"
#include "queries/tree_kernels.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

/// Finds the objects that the queries of a batch have to be tested against. `Part`: FramePart or SweptFrames.
///
/// Small batches are searched one query after another. Larger ones descend the tree together, in blocks, and then each
/// query tests what it reaches, the nearest first.
///
/// Each `test` is `double test(std::size_t query, const FrameObject&, const Pose&, double limit)`: it tests an object
/// and returns the limit from now on, a fraction, of points a distance in metres; negative if the query is answered.
/// Those of Wanted::first and Wanted::nearest also test in two steps: `test.place(query, object, pose)` for up to
/// PlacedRays::most queries, `test.run()`, and then `test.test_placed(i, query, object, limit)` for the i-th of them,
/// in their order. Of boxes that are reached behind `test.last_place(limit)` none is of interest.
///
/// Threads: belongs to one. Memory: grows to some megabytes, kept; without memory it searches one after another.
/// Failure: passes on what `test` throws, but geometry::SupportFailure, which it counts.
class BlockSearch {
 public:
  BlockSearch() : kernels_(choose_tree_kernels()) {}

  /// Which boxes a search tests.
  enum class Wanted {
    first,    ///< those that the query reaches, the nearest first, until the answer is known
    all,      ///< all that the query reaches
    near,     ///< of shapes: all that the ball around the shape touches at its start
    nearest,  ///< of points: as `first`, in the order of their distances
  };
  template <Wanted wanted, class Part, class Asked, class Test>
  void search(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, QueryWork& work,
              const Test& test);
  /// Query number `query` by its reach. `test(object, pose, limit)` as above. `by_distance`: the limit is a distance in
  /// metres.
  template <class Part, class Test>
  void search_one(const Part& part, const FrameMoment& moment, std::size_t query, const Reach& reach, double limit,
                  const QueryFilter& filter, QueryWork& work, const Test& test, bool by_distance) const;

 private:
  /// A query of a block that wants its first hit.
  struct Open {
    std::uint32_t number;  ///< in the block
    std::uint32_t next;    ///< in reached_
    std::uint32_t end;     ///< of its boxes there
    double limit;          ///< a box that is reached later does not count
  };
  template <Wanted wanted, class Part, class Asked, class Test>
  void search_rest(const Part& part, const FrameMoment& moment, const Asked& asked, std::size_t query, double limit,
                   QueryWork& work, const Test& test) const;
  template <Wanted wanted, class Part, class Asked, class Test>
  void search_each(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                   QueryWork& work, const Test& test) const;
  template <Wanted wanted, class Part, class Asked, class Test>
  void search_together(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                       QueryWork& work, const Test& test);
  template <class Part, class Asked, class Test>
  bool search_nearest_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                            std::size_t first, QueryWork& work, const Test& test);
  template <class Part, class Asked, class Test>
  void search_nearest_points(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                             std::size_t first, QueryWork& work, const Test& test);
  template <Wanted wanted, class Part, class Asked, class Test>
  bool search_step(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                   float begin, float end, QueryWork& work, const Test& test);
  template <class Part, class Asked, class Test>
  void test_nearest_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                          float begin, QueryWork& work, const Test& test);
  template <class Part, class Asked, class Test>
  void test_all(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                QueryWork& work, const Test& test);
  /// A range of open_.
  struct Chunk {
    std::size_t begin, end;
  };
  template <class Part, class Asked, class Test>
  std::size_t test_chunk(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                         Chunk of, std::size_t left, QueryWork& work, const Test& test);
  template <class Part>
  void prefetch(const Part& part, const FrameMoment& moment, std::size_t first, std::size_t i) const;
  bool reserve(std::size_t queries) noexcept;

  /// Fewer queries are searched one after another.
  static constexpr std::size_t smallest_batch = 8;
  /// Queries that descend the tree together.
  static constexpr std::size_t block = 4096;
  /// Objects are loaded this many tests in advance.
  static constexpr std::uint32_t prefetch_distance = 12;
  /// Queries whose next tests begin together.
  static constexpr std::size_t chunk = narrow_phase::PlacedRays::most;
  /// The distance within which nearest objects are searched first, relative to the size of a group of eight boxes.
  static constexpr double near_part = 0.25;

  static double first_limit(const AskedPoint& asked) noexcept { return asked.distance; }
  template <class Asked>
  static double first_limit(const Asked&) noexcept {
    return 1;
  }

  TreeKernels kernels_;
  ReachedBoxes reached_;
  base::FlatList<Open> unanswered_;     ///< of the block
  base::FlatList<std::uint32_t> open_;  ///< those of them that have boxes left to test
};

template <class Part, class Test>
void BlockSearch::search_one(const Part& part, const FrameMoment& moment, std::size_t query, const Reach& reach,
                             double limit, const QueryFilter& filter, QueryWork& work, const Test& test,
                             bool by_distance) const {
  struct Context {
    const Part& part;
    const FrameMoment& moment;
    std::size_t query;
    const QueryFilter& filter;
    QueryWork& work;
    const Test& test;
  } context{part, moment, query, filter, work, test};
  const VisitBox visit = [](void* of, std::uint32_t box, double most) {
    const Context& c = *static_cast<const Context*>(of);
    return test_object(c.part, c.moment, c.query, box, c.filter, most, c.work, c.test);
  };
  work.boxes += (by_distance ? kernels_.near : kernels_.reach)(part.tree(), reach, limit, visit, &context);
}

/// One after another. `first` is the number of the first query.
template <BlockSearch::Wanted wanted, class Part, class Asked, class Test>
void BlockSearch::search_each(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                              std::size_t first, QueryWork& work, const Test& test) const {
  for (std::size_t i = 0; i < asked.size(); ++i) {
    search_rest<wanted>(part, moment, asked[i], first + i, first_limit(asked[i]), work, test);
  }
}

/// One query, by itself, up to a limit.
template <BlockSearch::Wanted wanted, class Part, class Asked, class Test>
void BlockSearch::search_rest(const Part& part, const FrameMoment& moment, const Asked& asked, std::size_t query,
                              double limit, QueryWork& work, const Test& test) const {
  const auto test_one = [&](const FrameObject& object, const Pose& pose, double most) {
    return test(query, object, pose, most);
  };
  search_one(part, moment, query, reach_of(part.tree(), asked), limit, asked.filter, work, test_one,
             wanted == Wanted::nearest);
}

/// A block. If it reaches too much for the memory, its halves.
template <BlockSearch::Wanted wanted, class Part, class Asked, class Test>
void BlockSearch::search_together(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                                  std::size_t first, QueryWork& work, const Test& test) {
  if (asked.size() < smallest_batch) {
    search_each<wanted>(part, moment, asked, first, work, test);
    return;
  }
  if constexpr (wanted == Wanted::nearest) {
    search_nearest_points(part, moment, asked, first, work, test);
    return;
  } else if constexpr (wanted == Wanted::first) {
    if (search_nearest_first(part, moment, asked, first, work, test)) return;
  } else {
    constexpr bool near = wanted == Wanted::near;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      if constexpr (near) {
        reached_.reach(i) = near_reach_of(part.tree(), asked[i]);
      } else {
        reached_.reach(i) = reach_of(part.tree(), asked[i]);
      }
    }
    if (reached_.find(near ? kernels_.near_all : kernels_.reach_all, part.tree(), asked.size(), work.boxes)) {
      test_all(part, moment, asked, first, work, test);
      return;
    }
  }
  // What was tested before does no harm.
  const std::size_t half = asked.size() / 2;
  search_together<wanted>(part, moment, asked.first(half), first, work, test);
  search_together<wanted>(part, moment, asked.subspan(half), first + half, work, test);
}

/// In two steps, because the tree is searched for all boxes that a query reaches: those behind its first hit are not
/// searched if that is in the first part of its way. False if they reach too much for the memory.
template <class Part, class Asked, class Test>
bool BlockSearch::search_nearest_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                                       std::size_t first, QueryWork& work, const Test& test) {
  constexpr float first_part = 0.375f;
  unanswered_.clear();
  for (std::uint32_t i = 0; i < asked.size(); ++i) unanswered_.push_back({i, 0, 0, 1});
  return search_step<Wanted::first>(part, moment, asked, first, 0, first_part, work, test) &&
         search_step<Wanted::first>(part, moment, asked, first, first_part, 1, work, test);
}

/// First within a distance in which most points have an object, then within twice that, because all boxes within it are
/// searched. Points that are far from all objects are searched one after another, and so are all if that distance has
/// too many.
template <class Part, class Asked, class Test>
void BlockSearch::search_nearest_points(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                                        std::size_t first, QueryWork& work, const Test& test) {
  // The side of a cube with the mean surface of the groups of eight boxes.
  const double side = std::sqrt(part.tree().cost() * (static_cast<double>(tree_width) / 3));
  const float near = static_cast<float>(near_part * side);
  unanswered_.clear();
  for (std::uint32_t i = 0; i < asked.size(); ++i) unanswered_.push_back({i, 0, 0, first_limit(asked[i])});
  if (search_step<Wanted::nearest>(part, moment, asked, first, 0, near, work, test)) {
    search_step<Wanted::nearest>(part, moment, asked, first, near, 2 * near, work, test);
  }
  for (const Open& query : unanswered_.span()) {
    search_rest<Wanted::nearest>(part, moment, asked[query.number], first + query.number, query.limit, work, test);
  }
}

/// Tests what the unanswered queries reach between two fractions or distances. False if they reach too much for the
/// memory.
template <BlockSearch::Wanted wanted, class Part, class Asked, class Test>
bool BlockSearch::search_step(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                              std::size_t first, float begin, float end, QueryWork& work, const Test& test) {
  for (std::size_t i = 0; i < unanswered_.size(); ++i) {
    Reach& reach = reached_.reach(i) = reach_of(part.tree(), asked[unanswered_[i].number]);
    reach.begin = begin;
    reach.limit = std::min(end, static_cast<float>(unanswered_[i].limit * (1 + 0x1p-19)));
  }
  constexpr bool near = wanted == Wanted::nearest;
  if (!reached_.find(near ? kernels_.near_all : kernels_.reach_all, part.tree(), unanswered_.size(), work.boxes)) {
    return false;
  }
  test_nearest_first(part, moment, asked, first, near ? begin * begin : begin, work, test);
  std::size_t left = 0;
  for (std::size_t i = 0; i < unanswered_.size(); ++i) {
    unanswered_[left] = unanswered_[i];
    left += unanswered_[i].limit * (1 + 0x1p-18) > double{end} ? 1 : 0;
  }
  unanswered_.resize(left);
  return true;
}

/// In rounds: in each, every query that has boxes left tests the nearest of them.
template <class Part, class Asked, class Test>
void BlockSearch::test_nearest_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                                     std::size_t first, float begin, QueryWork& work, const Test& test) {
  open_.clear();
  for (std::uint32_t i = 0; i < unanswered_.size(); ++i) {
    // What is reached before the begin was tested in the step before.
    const std::uint32_t next = reached_.start(i, begin), end = reached_.end(i);
    if (next == end) continue;
    unanswered_[i].next = next;
    unanswered_[i].end = end;
    open_.push_back(i);
  }
  while (!open_.empty()) {
    std::size_t left = 0;
    for (std::size_t i = 0; i < std::min(open_.size(), chunk); ++i) prefetch(part, moment, first, i);
    for (std::size_t i = 0; i < open_.size(); i += chunk) {
      left = test_chunk(part, moment, asked, first, {i, std::min(i + chunk, open_.size())}, left, work, test);
    }
    open_.resize(left);
  }
}

/// Prefetches what the i-th open query tests next, and the place of what a later one does.
template <class Part>
inline void BlockSearch::prefetch(const Part& part, const FrameMoment& moment, std::size_t first, std::size_t i) const {
  const std::size_t last = open_.size() - 1;
  part.prefetch_place(reached_[unanswered_[open_[std::min(i + prefetch_distance, last)]].next].box);
  const Open& query = unanswered_[open_[std::min(i, last)]];
  prefetch_at(part, moment, first + query.number, reached_[query.next].box);
}

/// The open queries of a chunk test their nearest boxes. Keeps those that go on, behind the first `left`; returns how
/// many there are then.
template <class Part, class Asked, class Test>
std::size_t BlockSearch::test_chunk(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                                    std::size_t first, Chunk of, std::size_t left, QueryWork& work, const Test& test) {
  const FrameObject* objects[chunk];  // null: nothing is tested
  for (std::size_t i = of.begin; i < of.end; ++i) {
    const Open& query = unanswered_[open_[i]];
    const std::uint32_t box = reached_[query.next].box;
    const std::size_t number = first + query.number;
    const FrameObject*& object = objects[i - of.begin] =
        admitted_at(part, moment, number, box, asked[query.number].filter);
    if (object != nullptr) test.place(number, *object, pose_at(part, moment, number, box));
  }
  test.run();
  std::size_t placed = 0;
  for (std::size_t i = of.begin; i < of.end; ++i) {
    prefetch(part, moment, first, i + chunk);
    Open& query = unanswered_[open_[i]];
    if (const FrameObject* const object = objects[i - of.begin]; object != nullptr) {
      query.limit = guarded(work, query.limit,
                            [&] { return test.test_placed(placed, first + query.number, *object, query.limit); });
      ++placed;
    }
    reached_.bring_nearest(++query.next, query.end);
    const bool goes_on = query.next != query.end && double{reached_[query.next].at} <= test.last_place(query.limit);
    open_[left] = open_[i];
    left += goes_on ? 1 : 0;
  }
  return left;
}

/// In the order of the queries.
template <class Part, class Asked, class Test>
void BlockSearch::test_all(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, std::size_t first,
                           QueryWork& work, const Test& test) {
  const std::uint32_t last = reached_.end(asked.size() - 1) - 1;
  std::uint32_t soon = 0;  // the query of the box that is prefetched
  for (std::uint32_t i = 0, next = 0; i < asked.size(); ++i) {
    const auto test_one = [&](const FrameObject& object, const Pose& pose, double limit) {
      return test(first + i, object, pose, limit);
    };
    for (; next != reached_.end(i); ++next) {
      const std::uint32_t ahead = std::min<std::uint32_t>(next + prefetch_distance, last);
      while (reached_.end(soon) <= ahead) ++soon;
      part.prefetch_place(reached_[std::min<std::uint32_t>(next + 2 * prefetch_distance, last)].box);
      prefetch_at(part, moment, first + soon, reached_[ahead].box);
      test_object(part, moment, first + i, reached_[next].box, asked[i].filter, 1, work, test_one);
    }
  }
}

template <BlockSearch::Wanted wanted, class Part, class Asked, class Test>
void BlockSearch::search(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, QueryWork& work,
                         const Test& test) {
  if (asked.size() < smallest_batch || !reserve(std::min(block, asked.size()))) {
    search_each<wanted>(part, moment, asked, 0, work, test);
    return;
  }
  for (std::size_t first = 0; first < asked.size(); first += block) {
    search_together<wanted>(part, moment, asked.subspan(first, std::min(block, asked.size() - first)), first, work,
                            test);
  }
}

inline bool BlockSearch::reserve(std::size_t queries) noexcept try {
  unanswered_.reserve(queries);
  open_.reserve(queries);
  return reached_.reserve(queries);
} catch (const std::bad_alloc&) {
  return false;
}

}  // namespace ringfence::queries
