#include "nodes/host/host_senses.hpp"

#include <algorithm>
#include <new>

#include "geometry/vector.hpp"
#include "nodes/host/query_arguments.hpp"
#include "queries/hits.hpp"

namespace ringfence::nodes {

using queries::AskedPoint;
using queries::AskedRay;
using queries::AskedShape;
using queries::FrameMoment;
using queries::FramePart;
using queries::ObjectHit;
using queries::ObjectPoint;

namespace {

/// Writes the list of a query.
class HitList final : public queries::ListSink {
 public:
  explicit HitList(std::vector<Hit>& list) noexcept : list_(list) {}
  void add(std::uint32_t, std::span<const ObjectHit> hits) override {
    for (const ObjectHit& hit : hits) queries::set(list_.emplace_back(), hit);
  }

 private:
  std::vector<Hit>& list_;
};

}  // namespace

void HostSenses::give(std::span<MotionInput> inputs, std::span<const Hosted> objects) {
  around_.clear();
  around_.reserve(inputs.size());  // the inputs point to the entries
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const messages::ObjectRef& object = objects[i].object;
    inputs[i].senses =
        &around_.emplace_back(*this, ObjectId::of(object.number, object.generation), inputs[i].pose.position);
  }
}

// A ray reaches farthest at one of its ends, and so does the ball around a shape that moves.

double HostSenses::Around::reach_of(const RayQuery& query) const noexcept {
  return std::max(length(query.start - position_), length(query.start + query.displacement - position_));
}

double HostSenses::Around::reach_of(const SweepQuery& query) const noexcept {
  const double radius = senses_->frame_->shapes().row(query.shape.number()).bounding_radius;
  return reach_of(RayQuery{query.start.position, query.displacement}) + radius;
}

double HostSenses::Around::reach_of(const OverlapQuery& query) const noexcept {
  return reach_of(SweepQuery{query.shape, query.pose, {}});
}

double HostSenses::Around::reach_of(const NearestQuery& query) const noexcept {
  return length(query.point - position_) + query.distance;
}

template <class Asked, class Query>
Status HostSenses::Around::check(const Query& query, Asked& asked) const noexcept {
  const queries::RecordedFrame* const frame = senses_->frame_;
  if (frame == nullptr) return Status::out_of_order;
  if (query.frame && *query.frame != static_cast<double>(frame->number())) return Status::frame_expired;
  if (const Status status = nodes::check(query, *frame, asked); status != Status::ok) return status;
  return reach_of(query) <= senses_->distance_ ? Status::ok : Status::beyond_sense;
}

template <class Asked, class Found, class Query, class Search>
Hit HostSenses::Around::first(const Query& query, Search search) const noexcept try {
  Hit hit;
  Asked asked;
  hit.status = check(query, asked);
  if (hit.status != Status::ok) return hit;
  const queries::RecordedFrame& frame = *senses_->frame_;
  Found found;
  QueryWork work;
  (senses_->searcher_.*search)(frame.standing(), FrameMoment{frame.shapes()}, std::span<const Asked>(&asked, 1),
                               std::span<Found>(&found, 1), work);
  queries::set(hit, found);
  return hit;
} catch (const std::bad_alloc&) {
  Hit hit;
  hit.status = Status::out_of_memory;
  return hit;
}

Hit HostSenses::Around::cast(const RayQuery& query) const noexcept {
  return first<AskedRay, ObjectHit>(query, &queries::Searcher::cast<FramePart>);
}

Hit HostSenses::Around::sweep(const SweepQuery& query) const noexcept {
  return first<AskedShape, ObjectHit>(query, &queries::Searcher::sweep<FramePart>);
}

Hit HostSenses::Around::nearest(const NearestQuery& query) const noexcept {
  return first<AskedPoint, ObjectPoint>(query, &queries::Searcher::nearest<FramePart>);
}

AnyHit HostSenses::Around::cast_any(const RayQuery& query) const noexcept try {
  AskedRay asked;
  AnyHit hit;
  hit.status = check(query, asked);
  if (hit.status != Status::ok) return hit;
  const queries::RecordedFrame& frame = *senses_->frame_;
  QueryWork work;
  senses_->searcher_.cast_any(frame.standing(), FrameMoment{frame.shapes()}, {&asked, 1}, {&hit.hit, 1}, work);
  return hit;
} catch (const std::bad_alloc&) {
  return {Status::out_of_memory, false};
}

SensedHits HostSenses::Around::overlap(const OverlapQuery& query) const noexcept try {
  AskedShape asked;
  const Status status = check(query, asked);
  if (status != Status::ok) return {status, {}};
  const queries::RecordedFrame& frame = *senses_->frame_;
  std::vector<Hit>& list = senses_->list_;
  list.clear();
  HitList sink(list);
  QueryWork work;
  senses_->searcher_.overlap(frame.standing(), FrameMoment{frame.shapes()}, {&asked, 1}, sink, work);
  std::sort(list.begin(), list.end(), [](const Hit& p, const Hit& q) { return p.object.number() < q.object.number(); });
  return {Status::ok, list};
} catch (const std::bad_alloc&) {
  return {Status::out_of_memory, {}};
}

}  // namespace ringfence::nodes
