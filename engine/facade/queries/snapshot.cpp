#include "ringfence/snapshot.hpp"

#include <algorithm>
#include <new>
#include <utility>
#include <vector>

#include "base/flat_list.hpp"
#include "base/floating_point.hpp"
#include "base/prefetch.hpp"
#include "facade/queries/query_target.hpp"
#include "nodes/host/query_arguments.hpp"
#include "queries/hits.hpp"

namespace ringfence {
namespace {

using facade::PinnedFrames;
using facade::QueryTarget;
using queries::AskedPoint;
using queries::AskedRay;
using queries::AskedShape;
using queries::ObjectHit;
using queries::ObjectPoint;
using queries::Searcher;

using queries::set;
void set(AnyHit& hit, bool found) noexcept { hit.hit = found; }

/// Prefetches what set() reads.
template <class Found>
void prefetch(const Found& found) noexcept {
  base::prefetch_for_read(found.object);
}
void prefetch(bool) noexcept {}

/// A hit in the list of a query.
struct ListOrder {
  double fraction;
  ObjectNumber number;
  std::uint32_t index;  ///< in the list

  bool operator<(const ListOrder& other) const noexcept {
    return fraction < other.fraction || (fraction == other.fraction && number < other.number);
  }
};

/// The queries of a block that are answered together.
struct Block {
  base::FlatList<std::uint32_t> numbers;     ///< in the caller's batch
  base::FlatList<queries::QueryTime> times;  ///< of those that SweptFrames answer

  void clear() {
    numbers.clear();
    times.clear();
  }
};

/// Puts the lists of a block in order, and writes them to the caller's.
class HitListSink final : public queries::ListSink {
 public:
  HitListSink(const Block& block, std::vector<ListOrder>& order, HitLists& lists)
      : block_(block), order_(order), lists_(lists) {}

  void add(std::uint32_t query, std::span<const ObjectHit> hits) override {
    order_.clear();
    for (std::uint32_t i = 0; i < hits.size(); ++i) {
      order_.push_back({hits[i].hit.fraction, hits[i].object->number, i});
      base::prefetch_for_read(hits[i].object);
    }
    std::sort(order_.begin(), order_.end());
    for (const ListOrder& next : order_) set(lists_.add(block_.numbers[query]), hits[next.index]);
  }

 private:
  const Block& block_;
  std::vector<ListOrder>& order_;
  HitLists& lists_;
};

/// What a thread needs to answer batches with one kind of arguments. It is kept, because to allocate it for each batch
/// would take longer than many answers.
template <class Asked>
struct Workspace {
  facade::FrameOrder order;
  Block block;
  base::FlatList<Asked> asked;  ///< of the block
  base::FlatList<ObjectHit> hits;
  base::FlatList<ObjectPoint> points;
  base::FlatList<bool> any;
  std::vector<ListOrder> list;  ///< of one query

  auto& found(const Hit*, const AskedPoint*) { return points; }
  template <class Other>
  auto& found(const Hit*, const Other*) {
    return hits;
  }
  auto& found(const AnyHit*, const AskedRay*) { return any; }
};

Searcher& searcher() {
  thread_local Searcher mine;
  return mine;
}

template <class Asked>
Workspace<Asked>& workspace() {
  thread_local Workspace<Asked> mine;
  return mine;
}

/// Calls `answer(part, moment)` for each block of valid queries with the same index, which are then in `space`.
/// `refuse(query, status)` receives the others.
template <class Asked, class Query, class Answer, class Refuse>
void for_each_block(const PinnedFrames* frames, std::span<const Query> queries, Workspace<Asked>& space,
                    const Answer& answer, const Refuse& refuse) {
  constexpr std::size_t most = 4096;
  QueryTarget target;
  const QueryFrame* about = nullptr;
  const auto clear = [&] {
    space.asked.clear();
    space.block.clear();
  };
  const auto finish = [&] {
    if (!space.asked.empty()) {
      // The last frame has the shapes of the others too.
      const queries::FrameMoment moment{frames->last().shapes(), space.block.times.span()};
      target.standing != nullptr ? answer(*target.standing, moment) : answer(*target.swept, moment);
    }
    clear();
  };
  clear();
  space.order.set(queries);
  for (std::size_t next = 0; next < queries.size(); ++next) {
    const std::size_t i = space.order[next];
    if (about == nullptr || queries[i].frame != *about) {
      about = &queries[i].frame;
      const QueryTarget then = find_target(frames, *about);
      if (!then.has_index_of(target)) finish();
      target = then;
    }
    if (space.asked.size() == most) finish();
    const Status status =
        target.status != Status::ok ? target.status : nodes::check(queries[i], *target.frame, space.asked.add());
    if (status != Status::ok) {
      if (target.status == Status::ok) space.asked.pop_back();
      refuse(i, status);
      continue;
    }
    space.block.numbers.push_back(static_cast<std::uint32_t>(i));
    space.block.times.push_back(target.time);
  }
  finish();
}

/// A batch with one answer for each query: `search(part, moment, asked, found, work)` finds them.
template <class Asked, class Found, class Query, class Answer, class Search>
void answer_each(const PinnedFrames* frames, std::span<const Query> queries, std::span<Answer> answers, QueryWork* work,
                 const Search& search) noexcept try {
  const base::DefaultFloatingPoint floating_point;
  Workspace<Asked>& space = workspace<Asked>();
  base::FlatList<Found>& found = space.found(answers.data(), static_cast<const Asked*>(nullptr));
  QueryWork done;
  done.queries = queries.size();
  const auto answer_block = [&](const auto& part, const queries::FrameMoment& moment) {
    found.resize(space.asked.size());
    std::fill(found.begin(), found.end(), Found());
    search(part, moment, space.asked.span(), std::span<Found>(found.data(), found.size()), done);
    const Block& block = space.block;
    constexpr std::size_t ahead = 16;
    for (std::size_t i = 0; i < found.size(); ++i) {
      prefetch(found[std::min(i + ahead, found.size() - 1)]);
      // Built in registers: GCC clears memory of this size by `rep stos`, which takes 20 ns.
      Answer answer;
      set(answer, found[i]);
      answers[block.numbers[i]] = answer;
    }
  };
  for_each_block(frames, queries, space, answer_block, [&](std::size_t query, Status status) {
    answers[query] = {};
    answers[query].status = status;
  });
  if (work != nullptr) *work += done;
} catch (const std::bad_alloc&) {
  for (Answer& answer : answers) {
    answer = {};
    answer.status = Status::out_of_memory;
  }
}

/// A batch with a list for each query, in order of (fraction, number); `search(part, moment, asked, sink, work)`
/// appends the hits.
template <class Asked, class Query, class Search>
void list_each(const PinnedFrames* frames, std::span<const Query> queries, HitLists& lists, QueryWork* work,
               const Search& search) {
  const base::DefaultFloatingPoint floating_point;
  Workspace<Asked>& space = workspace<Asked>();
  QueryWork done;
  done.queries = queries.size();
  lists.start(queries.size());
  HitListSink sink(space.block, space.list, lists);
  const auto answer_block = [&](const auto& part, const queries::FrameMoment& moment) {
    search(part, moment, space.asked.span(), sink, done);
  };
  for_each_block(frames, queries, space, answer_block,
                 [&](std::size_t query, Status status) { lists.set_status(query, status); });
  if (work != nullptr) *work += done;
}

}  // namespace

std::uint64_t Snapshot::frame() const noexcept { return frames_->last().number(); }
std::uint64_t Snapshot::oldest_frame() const noexcept { return frames_->first().number(); }
std::size_t Snapshot::objects() const noexcept { return frames_ == nullptr ? 0 : frames_->last().size(); }

void Snapshot::cast(std::span<const RayQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<AskedRay, ObjectHit>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().cast(of...); });
}
void Snapshot::cast_any(std::span<const RayQuery> queries, std::span<AnyHit> hits, QueryWork* work) const noexcept {
  answer_each<AskedRay, bool>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().cast_any(of...); });
}
void Snapshot::cast_all(std::span<const RayQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<AskedRay>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().cast_all(of...); });
}
void Snapshot::sweep(std::span<const SweepQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<AskedShape, ObjectHit>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().sweep(of...); });
}
void Snapshot::sweep_all(std::span<const SweepQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<AskedShape>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().sweep_all(of...); });
}
void Snapshot::overlap(std::span<const OverlapQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<AskedShape>(frames_.get(), queries, hits, work, [](auto&&... of) { searcher().overlap(of...); });
}
void Snapshot::nearest(std::span<const NearestQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<AskedPoint, ObjectPoint>(frames_.get(), queries, hits, work,
                                       [](auto&&... of) { searcher().nearest(of...); });
}

}  // namespace ringfence
