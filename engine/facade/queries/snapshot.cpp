#include "ringfence/snapshot.hpp"

#include <algorithm>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "base/floating_point.hpp"
#include "facade/queries/arguments.hpp"
#include "facade/queries/frame_store.hpp"
#include "facade/queries/query_order.hpp"

namespace ringfence {
namespace {

using facade::MovingShape;
using facade::NoArguments;
using facade::PinnedFrames;
using facade::QueryOrder;
using queries::FrameMoment;
using queries::FramePart;
using queries::ObjectHit;
using queries::RecordedFrame;

/// The frame that a query asks about, with the index that answers it.
struct Target {
  Status status = Status::ok;
  const RecordedFrame* frame = nullptr;
  const FramePart* part = nullptr;
  double fraction = 0;

  FrameMoment moment() const noexcept { return {frame->shapes(), fraction}; }
};

Target find_target(const PinnedFrames& frames, const QueryFrame& wanted) noexcept try {
  if (!wanted) return {Status::ok, &frames.last(), &frames.last().standing(), 0};
  PinnedFrames::Moment moment;
  if (const Status status = frames.find(*wanted, moment); status != Status::ok) return {status};
  const FramePart& part = moment.next == nullptr ? moment.frame->standing() : moment.frame->moving_to(*moment.next);
  return {Status::ok, moment.frame, &part, moment.fraction};
} catch (const std::bad_alloc&) {
  return {Status::out_of_memory};
}

Hit hit_of(const Target& target, const queries::FrameObject& object) noexcept {
  Hit hit;
  hit.object = ObjectId::of(object.number, object.generation);
  hit.user_data = target.frame->user_data(object.slot);
  return hit;
}

Hit hit_of(const Target& target, const ObjectHit& found) noexcept {
  if (found.object == nullptr) return {};
  Hit hit = hit_of(target, *found.object);
  hit.fraction = found.hit.fraction;
  hit.normal = found.hit.normal;
  hit.point = found.hit.point;
  hit.child = found.hit.child;
  hit.triangle = found.hit.triangle;
  return hit;
}

Hit hit_of(const Target& target, const queries::ObjectPoint& found) noexcept {
  if (found.object == nullptr) return {};
  Hit hit = hit_of(target, *found.object);
  hit.distance = found.nearest.distance;
  hit.point = found.nearest.point;
  hit.child = found.nearest.child;
  hit.triangle = found.nearest.triangle;
  return hit;
}

/// Answers one query: `compute(target, arguments)` is called if it is valid. Returns its status.
template <class Arguments, class Query, class Compute>
Status answer(const PinnedFrames* frames, const Query& query, const Compute& compute) {
  if (frames == nullptr) return Status::out_of_order;
  const Target target = find_target(*frames, query.frame);
  if (target.status != Status::ok) return target.status;
  Arguments arguments;
  const Status status = facade::check(query, *target.frame, arguments);
  if (status == Status::ok) compute(target, arguments);
  return status;
}

/// Null for small batches, or if there is no memory for it.
template <class Query>
std::optional<QueryOrder> order_of(std::span<const Query> queries) noexcept try {
  constexpr std::size_t small = 64;
  return queries.size() < small ? std::optional<QueryOrder>() : std::optional<QueryOrder>(queries);
} catch (const std::bad_alloc&) {
  return std::nullopt;
}

/// A batch with one answer for each query: `compute(query, target, arguments, answer, work)` sets it.
template <class Arguments, class Query, class Answer, class Compute>
void answer_each(const PinnedFrames* frames, std::span<const Query> queries, std::span<Answer> answers, QueryWork* work,
                 const Compute& compute) {
  const base::DefaultFloatingPoint floating_point;
  QueryWork done;
  done.queries = queries.size();
  const std::optional<QueryOrder> order = order_of(queries);
  for (std::size_t next = 0; next < queries.size(); ++next) {
    const std::size_t i = order ? (*order)[next] : next;
    answers[i] = {};
    answers[i].status = answer<Arguments>(frames, queries[i], [&](const Target& target, const Arguments& arguments) {
      compute(queries[i], target, arguments, answers[i], done);
    });
  }
  if (work != nullptr) *work += done;
}

/// A batch with a list for each query: `find(query, target, arguments, found, work)` appends what it finds, in any
/// order. Each list is put in order of (fraction, number).
template <class Arguments, class Query, class Find>
void list_each(const PinnedFrames* frames, std::span<const Query> queries, HitLists& lists, QueryWork* work,
               const Find& find) {
  const base::DefaultFloatingPoint floating_point;
  QueryWork done;
  done.queries = queries.size();
  lists.clear();
  std::vector<ObjectHit> found;
  for (const Query& query : queries) {
    const Status status = answer<Arguments>(frames, query, [&](const Target& target, const Arguments& arguments) {
      found.clear();
      find(query, target, arguments, found, done);
      std::sort(found.begin(), found.end(), [](const ObjectHit& p, const ObjectHit& q) {
        return std::pair(p.hit.fraction, p.object->number) < std::pair(q.hit.fraction, q.object->number);
      });
      for (const ObjectHit& hit : found) lists.add(hit_of(target, hit));
    });
    lists.add_list(status);
  }
  if (work != nullptr) *work += done;
}

}  // namespace

std::uint64_t Snapshot::frame() const noexcept { return frames_->last().number(); }
std::uint64_t Snapshot::oldest_frame() const noexcept { return frames_->first().number(); }
std::size_t Snapshot::objects() const noexcept { return frames_ == nullptr ? 0 : frames_->last().size(); }

void Snapshot::cast(std::span<const RayQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<narrow_phase::Ray>(
      frames_.get(), queries, hits, work,
      [](const RayQuery& query, const Target& target, const narrow_phase::Ray& ray, Hit& hit, QueryWork& done) {
        ObjectHit best;
        target.part->cast(target.moment(), ray, query.filter, best, done);
        hit = hit_of(target, best);
      });
}

void Snapshot::cast_any(std::span<const RayQuery> queries, std::span<AnyHit> hits, QueryWork* work) const noexcept {
  answer_each<narrow_phase::Ray>(
      frames_.get(), queries, hits, work,
      [](const RayQuery& query, const Target& target, const narrow_phase::Ray& ray, AnyHit& hit, QueryWork& done) {
        hit.hit = target.part->cast_any(target.moment(), ray, query.filter, done);
      });
}

void Snapshot::cast_all(std::span<const RayQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<narrow_phase::Ray>(
      frames_.get(), queries, hits, work,
      [](const RayQuery& query, const Target& target, const narrow_phase::Ray& ray, std::vector<ObjectHit>& found,
         QueryWork& done) { target.part->cast_all(target.moment(), ray, query.filter, found, done); });
}

void Snapshot::sweep(std::span<const SweepQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<MovingShape>(
      frames_.get(), queries, hits, work,
      [](const SweepQuery& query, const Target& target, const MovingShape& moving, Hit& hit, QueryWork& done) {
        ObjectHit best;
        target.part->sweep(target.moment(), moving.in(target.frame->shapes()), moving.path, query.filter, best, done);
        hit = hit_of(target, best);
      });
}

void Snapshot::sweep_all(std::span<const SweepQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<MovingShape>(frames_.get(), queries, hits, work,
                         [](const SweepQuery& query, const Target& target, const MovingShape& moving,
                            std::vector<ObjectHit>& found, QueryWork& done) {
                           target.part->sweep_all(target.moment(), moving.in(target.frame->shapes()), moving.path,
                                                  query.filter, found, done);
                         });
}

void Snapshot::overlap(std::span<const OverlapQuery> queries, HitLists& hits, QueryWork* work) const {
  list_each<MovingShape>(frames_.get(), queries, hits, work,
                         [](const OverlapQuery& query, const Target& target, const MovingShape& placed,
                            std::vector<ObjectHit>& found, QueryWork& done) {
                           target.part->overlap(target.moment(), placed.in(target.frame->shapes()), placed.path.start,
                                                query.filter, found, done);
                         });
}

void Snapshot::nearest(std::span<const NearestQuery> queries, std::span<Hit> hits, QueryWork* work) const noexcept {
  answer_each<NoArguments>(
      frames_.get(), queries, hits, work,
      [](const NearestQuery& query, const Target& target, const NoArguments&, Hit& hit, QueryWork& done) {
        queries::ObjectPoint best;
        target.part->nearest(target.moment(), query.point, query.distance, query.filter, best, done);
        hit = hit_of(target, best);
      });
}

}  // namespace ringfence
