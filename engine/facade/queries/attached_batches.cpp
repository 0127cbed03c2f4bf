#include "facade/queries/attached_batches.hpp"

#include <algorithm>
#include <type_traits>
#include <utility>

namespace ringfence::facade {
namespace {

using messages::QueryHitRecord;
using messages::QueryKind;
using messages::QueryRecord;

void set_arguments(QueryRecord& record, const queries::AskedRay& asked) noexcept {
  record.start.position = asked.ray.start;
  record.displacement = asked.ray.displacement;
}

void set_arguments(QueryRecord& record, const queries::AskedShape& asked) noexcept {
  record.shape = asked.shape.shape;
  record.start = {asked.path.start, asked.shape.orientation};
  record.displacement = asked.path.displacement;
}

void set_arguments(QueryRecord& record, const queries::AskedPoint& asked) noexcept {
  record.start.position = asked.point;
  record.distance = asked.distance;
}

void set_filter(QueryRecord& record, const QueryFilter& filter) noexcept {
  record.layers = filter.layers;
  record.categories = filter.categories;
  record.except_group = filter.except_group;
  record.except_number = filter.except.number();
  record.except_generation = filter.except.generation();
}

Hit hit_of(const nodes::ServerRole& server, const QueryHitRecord& found) noexcept {
  const messages::ObjectRef& object = server.objects().row(found.slot).object;
  Hit hit;
  hit.child = found.child;
  hit.triangle = found.triangle;
  hit.object = ObjectId::of(object.number, object.generation);
  hit.user_data = server.objects().origin(found.slot).user_data;
  hit.point = found.point;
  hit.normal = found.normal;
  return hit;
}

template <class Query>
Hit hit_of(const nodes::ServerRole& server, const QueryHitRecord& found) noexcept {
  Hit hit = hit_of(server, found);
  (std::is_same_v<Query, NearestQuery> ? hit.distance : hit.fraction) = found.place;
  return hit;
}

/// Answers the whole batch.
void answer(const Snapshot& snapshot, QueryBatch& batch, QueryWork& work) {
  QueryBatch::Answers& answers = batch.answers;
  answers.cast.resize(batch.cast.size());
  answers.cast_any.resize(batch.cast_any.size());
  answers.sweep.resize(batch.sweep.size());
  answers.nearest.resize(batch.nearest.size());
  snapshot.cast(batch.cast, answers.cast, &work);
  snapshot.cast_any(batch.cast_any, answers.cast_any, &work);
  snapshot.cast_all(batch.cast_all, answers.cast_all, &work);
  snapshot.sweep(batch.sweep, answers.sweep, &work);
  snapshot.sweep_all(batch.sweep_all, answers.sweep_all, &work);
  snapshot.overlap(batch.overlap, answers.overlap, &work);
  snapshot.nearest(batch.nearest, answers.nearest, &work);
}

}  // namespace

Status AttachedBatches::attach(QueryBatch& batch) {
  if (std::find(batches_.begin(), batches_.end(), &batch) != batches_.end()) {
    return Status::out_of_order;
  }
  batches_.push_back(&batch);
  return Status::ok;
}

void AttachedBatches::prepare(nodes::FrameOrder& order) {
  records_.clear();
  prepared_.clear();
  any_by_snapshot_ = false;
  if (!batches_.empty()) {
    shapes_.begin(0, false);
  }
  for (const QueryBatch* batch : batches_) {
    prepare<queries::AskedRay>(QueryKind::cast, batch->cast);
    prepare<queries::AskedRay>(QueryKind::cast_any, batch->cast_any);
    prepare<queries::AskedRay>(QueryKind::cast_all, batch->cast_all);
    prepare<queries::AskedShape>(QueryKind::sweep, batch->sweep);
    prepare<queries::AskedShape>(QueryKind::sweep_all, batch->sweep_all);
    prepare<queries::AskedShape>(QueryKind::overlap, batch->overlap);
    prepare<queries::AskedPoint>(QueryKind::nearest, batch->nearest);
  }
  order.queries = records_;
}

template <class Asked, class Query>
void AttachedBatches::prepare(QueryKind kind, const std::vector<Query>& of_kind) {
  for (const Query& query : of_kind) {
    if (query.frame) {
      prepared_.push_back({Status::ok, false});
      any_by_snapshot_ = true;
      continue;
    }
    Asked asked;
    const Status status = nodes::check(query, shapes_, asked);
    prepared_.push_back({status, status == Status::ok});
    if (status == Status::ok) {
      QueryRecord& record = records_.emplace_back();
      record.kind = static_cast<std::uint32_t>(kind);
      set_arguments(record, asked);
      set_filter(record, query.filter);
    }
  }
}

void AttachedBatches::answer(const nodes::ServerRole& server, FrameReport& report,
                             const std::function<Snapshot()>& snapshot) {
  const bool complete = records_.empty() || server.list_answers(answers_);
  const Snapshot needed = !complete || any_by_snapshot_ ? snapshot() : Snapshot();
  if (complete) {
    order_hits(server);
    report.queries.queries += records_.size();
  } else {
    report.recomputed_batches = batches_.size();
  }
  for (QueryBatch* batch : batches_) {
    if (complete) {
      merge(*batch, server, needed, report.queries);
    } else {
      facade::answer(needed, *batch, report.queries);
    }
    batch->answers.frame = report.frame;
  }
  batches_.clear();
  if (!report.lost.empty()) {
    abandoned_.push_back(std::exchange(records_, {}));
  }
}

// A counting sort by record: the nodes' lists are in this order already, so each pass reads them once.
void AttachedBatches::order_hits(const nodes::ServerRole& server) {
  ends_.assign(records_.size() + 1, 0);
  next_prepared_ = next_record_ = 0;
  if (records_.empty()) {
    return;
  }
  std::size_t total = 0;
  for (const nodes::NodeQueries* node : answers_) {
    total += node->hits.size();
    for (const QueryHitRecord& hit : node->hits) {
      ++ends_[hit.query + 1];
    }
  }
  for (std::size_t i = 1; i < ends_.size(); ++i) {
    ends_[i] += ends_[i - 1];
  }
  found_.resize(total);
  for (const nodes::NodeQueries* node : answers_) {
    for (const QueryHitRecord& hit : node->hits) {
      // ends_[i] is the start of record i, and becomes its end.
      found_[ends_[hit.query]++] = {hit.place, server.objects().row(hit.slot).object.number, &hit};
    }
  }
}

std::span<const AttachedBatches::Found> AttachedBatches::next_found() {
  const std::size_t begin = next_record_ == 0 ? 0 : ends_[next_record_ - 1];
  const std::span<Found> found = std::span(found_).subspan(begin, ends_[next_record_] - begin);
  ++next_record_;
  std::sort(found.begin(), found.end(),
            [](const Found& p, const Found& q) { return std::pair(p.place, p.number) < std::pair(q.place, q.number); });
  return found;
}

void AttachedBatches::merge(QueryBatch& batch, const nodes::ServerRole& server, const Snapshot& snapshot,
                            QueryWork& work) {
  QueryBatch::Answers& answers = batch.answers;
  merge_first(batch.cast, answers.cast, server, &Snapshot::cast, snapshot, work);
  merge_any(batch.cast_any, answers.cast_any, snapshot, work);
  merge_lists(batch.cast_all, answers.cast_all, server, &Snapshot::cast_all, snapshot, work);
  merge_first(batch.sweep, answers.sweep, server, &Snapshot::sweep, snapshot, work);
  merge_lists(batch.sweep_all, answers.sweep_all, server, &Snapshot::sweep_all, snapshot, work);
  merge_lists(batch.overlap, answers.overlap, server, &Snapshot::overlap, snapshot, work);
  merge_first(batch.nearest, answers.nearest, server, &Snapshot::nearest, snapshot, work);
}

template <class Query>
void AttachedBatches::merge_first(const std::vector<Query>& queries, std::vector<Hit>& hits,
                                  const nodes::ServerRole& server,
                                  void (Snapshot::*otherwise)(std::span<const Query>, std::span<Hit>, QueryWork*)
                                      const noexcept,
                                  const Snapshot& snapshot, QueryWork& work) {
  hits.assign(queries.size(), Hit());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Prepared& prepared = prepared_[next_prepared_++];
    if (prepared.by_nodes) {
      if (const auto found = next_found(); !found.empty()) {
        hits[i] = hit_of<Query>(server, *found.front().hit);
      }
    } else if (prepared.status != Status::ok) {
      hits[i].status = prepared.status;
      ++work.queries;
    } else {
      (snapshot.*otherwise)({&queries[i], 1}, {&hits[i], 1}, &work);
    }
  }
}

template <class Query>
void AttachedBatches::merge_lists(const std::vector<Query>& queries, HitLists& lists, const nodes::ServerRole& server,
                                  void (Snapshot::*otherwise)(std::span<const Query>, HitLists&, QueryWork*) const,
                                  const Snapshot& snapshot, QueryWork& work) {
  lists.start(queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Prepared& prepared = prepared_[next_prepared_++];
    if (prepared.by_nodes) {
      for (const Found& found : next_found()) {
        lists.add(i) = hit_of<Query>(server, *found.hit);
      }
    } else if (prepared.status != Status::ok) {
      lists.set_status(i, prepared.status);
      ++work.queries;
    } else {
      (snapshot.*otherwise)({&queries[i], 1}, list_, &work);
      for (const Hit& hit : list_.all()) {
        lists.add(i) = hit;
      }
      lists.set_status(i, list_.status(0));
    }
  }
}

void AttachedBatches::merge_any(const std::vector<RayQuery>& queries, std::vector<AnyHit>& hits,
                                const Snapshot& snapshot, QueryWork& work) {
  hits.assign(queries.size(), AnyHit());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Prepared& prepared = prepared_[next_prepared_++];
    if (prepared.by_nodes) {
      hits[i].hit = !next_found().empty();
    } else if (prepared.status != Status::ok) {
      hits[i].status = prepared.status;
      ++work.queries;
    } else {
      snapshot.cast_any({&queries[i], 1}, {&hits[i], 1}, &work);
    }
  }
}

}  // namespace ringfence::facade
