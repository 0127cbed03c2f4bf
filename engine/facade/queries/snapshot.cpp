#include "ringfence/snapshot.hpp"

#include <algorithm>
#include <new>
#include <utility>
#include <vector>

#include "base/flat_list.hpp"
#include "base/floating_point.hpp"
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

template <class Found>
void set(Hit& hit, const QueryTarget& target, const Found& found) noexcept {
  queries::set(hit, *target.frame, found);
}

template <class Found>
void prefetch(const QueryTarget& target, const Found& found) noexcept {
  if (found.object != nullptr) target.frame->prefetch_user_data(found.object->slot);
}
void prefetch(const QueryTarget&, bool) noexcept {}

void set(AnyHit& hit, const QueryTarget&, bool found) noexcept { hit.hit = found; }

/// A hit in the list of a query.
struct ListOrder {
  double fraction;
  ObjectNumber number;
  std::uint32_t index;  ///< in the list

  bool operator<(const ListOrder& other) const noexcept {
    return fraction < other.fraction || (fraction == other.fraction && number < other.number);
  }
};

/// Puts the lists of a block in order, and writes them to the caller's.
class HitListSink final : public queries::ListSink {
 public:
  HitListSink(const QueryTarget& target, std::span<const std::uint32_t> numbers, std::vector<ListOrder>& order,
              HitLists& lists)
      : target_(target), numbers_(numbers), order_(order), lists_(lists) {}

  void add(std::uint32_t query, std::span<const ObjectHit> hits) override {
    order_.clear();
    for (std::uint32_t i = 0; i < hits.size(); ++i) {
      order_.push_back({hits[i].hit.fraction, hits[i].object->number, i});
      target_.frame->prefetch_user_data(hits[i].object->slot);
    }
    std::sort(order_.begin(), order_.end());
    for (const ListOrder& next : order_) set(lists_.add(numbers_[query]), target_, hits[next.index]);
  }

 private:
  const QueryTarget& target_;
  std::span<const std::uint32_t> numbers_;
  std::vector<ListOrder>& order_;
  HitLists& lists_;
};

/// What a thread needs to answer batches with one kind of arguments. It is kept, because to allocate it for each batch
/// would take longer than many answers.
template <class Asked>
struct Workspace {
  facade::FrameOrder order;
  std::vector<std::uint32_t> numbers;  ///< of the queries of a block
  std::vector<Asked> asked;            ///< a block
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

/// Calls `answer(target)` for each block of valid queries about the same time, which are then in `space`.
/// `refuse(query, status)` receives the others.
template <class Asked, class Query, class Answer, class Refuse>
void for_each_block(const PinnedFrames* frames, std::span<const Query> queries, Workspace<Asked>& space,
                    const Answer& answer, const Refuse& refuse) {
  constexpr std::size_t block = 4096;
  QueryTarget target;
  const QueryFrame* about = nullptr;
  space.asked.clear();
  space.numbers.clear();
  const auto finish = [&] {
    if (!space.asked.empty()) answer(target);
    space.asked.clear();
    space.numbers.clear();
  };
  space.order.set(queries);
  for (std::size_t next = 0; next < queries.size(); ++next) {
    const std::size_t i = space.order[next];
    if (about == nullptr || queries[i].frame != *about || space.asked.size() == block) {
      finish();
      about = &queries[i].frame;
      target = find_target(frames, *about);
    }
    Asked asked;
    const Status status = target.status != Status::ok ? target.status : nodes::check(queries[i], *target.frame, asked);
    if (status == Status::ok) {
      space.asked.push_back(asked);
      space.numbers.push_back(static_cast<std::uint32_t>(i));
    } else {
      refuse(i, status);
    }
  }
  finish();
}

/// A batch with one answer for each query: `(searcher.*search)(...)` finds them.
template <class Asked, class Query, class Answer, class Found>
void answer_each(const PinnedFrames* frames, std::span<const Query> queries, std::span<Answer> answers, QueryWork* work,
                 void (Searcher::*search)(const queries::FramePart&, const queries::FrameMoment&,
                                          std::span<const Asked>, std::span<Found>, QueryWork&) noexcept) noexcept try {
  const base::DefaultFloatingPoint floating_point;
  Workspace<Asked>& space = workspace<Asked>();
  base::FlatList<Found>& found = space.found(answers.data(), static_cast<const Asked*>(nullptr));
  QueryWork done;
  done.queries = queries.size();
  const auto answer_block = [&](const QueryTarget& target) {
    found.resize(space.asked.size());
    std::fill(found.begin(), found.end(), Found());
    (searcher().*search)(*target.part, target.moment(), space.asked, {found.data(), found.size()}, done);
    for (const Found& one : found) prefetch(target, one);
    for (std::size_t i = 0; i < space.asked.size(); ++i) {
      Answer& answer = answers[space.numbers[i]];
      answer = {};
      set(answer, target, found[i]);
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

/// A batch with a list for each query, in order of (fraction, number); `(searcher.*search)(...)` appends the hits.
template <class Asked, class Query>
void list_each(const PinnedFrames* frames, std::span<const Query> queries, HitLists& lists, QueryWork* work,
               void (Searcher::*search)(const queries::FramePart&, const queries::FrameMoment&, std::span<const Asked>,
                                        queries::ListSink&, QueryWork&)) {
  const base::DefaultFloatingPoint floating_point;
  Workspace<Asked>& space = workspace<Asked>();
  QueryWork done;
  done.queries = queries.size();
  lists.start(queries.size());
  const auto answer_block = [&](const QueryTarget& target) {
    HitListSink sink(target, space.numbers, space.list, lists);
    (searcher().*search)(*target.part, target.moment(), space.asked, sink, done);
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
  answer_each(frames_.get(), queries, hits, work, &Searcher::cast);
}
void Snapshot::cast_any(std::span<const RayQuery> queries, std::span<AnyHit> hits, QueryWork* work) const noexcept {
  answer_each(frames_.get(), queries, hits, work, &Searcher::cast_any);
}
void Snapshot::cast_all(std::span<const RayQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each(frames_.get(), queries, hits, work, &Searcher::cast_all);
}
void Snapshot::sweep(std::span<const SweepQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each(frames_.get(), queries, hits, work, &Searcher::sweep);
}
void Snapshot::sweep_all(std::span<const SweepQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each(frames_.get(), queries, hits, work, &Searcher::sweep_all);
}
void Snapshot::overlap(std::span<const OverlapQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each(frames_.get(), queries, hits, work, &Searcher::overlap);
}
void Snapshot::nearest(std::span<const NearestQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each(frames_.get(), queries, hits, work, &Searcher::nearest);
}

}  // namespace ringfence
