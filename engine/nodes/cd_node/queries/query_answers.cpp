#include "nodes/cd_node/queries/query_answers.hpp"

namespace ringfence::nodes {
namespace {

using messages::QueryHitRecord;
using messages::QueryKind;

QueryFilter filter_of(const messages::QueryRecord& record) noexcept {
  return {record.layers, record.categories, record.except_group,
          ObjectId::of(record.except_number, record.except_generation)};
}

QueryHitRecord record_of(std::uint32_t query, const queries::ObjectHit& found) noexcept {
  const narrow_phase::ShapeHit& hit = found.hit;
  return {query, found.object->slot, hit.child, hit.triangle, hit.fraction, hit.point, hit.normal};
}

QueryHitRecord record_of(std::uint32_t query, const queries::ObjectPoint& found) noexcept {
  const narrow_phase::NearestPoint& nearest = found.nearest;
  return {query, found.object->slot, nearest.child, nearest.triangle, nearest.distance, nearest.point, {}};
}

}  // namespace

void QueryAnswers::add(const queries::FramePart& part, const geometry::ShapeView& shapes, std::uint32_t query,
                       const messages::QueryRecord& record, std::vector<QueryHitRecord>& hits, QueryWork& work) {
  const queries::FrameMoment moment{shapes};
  const QueryFilter filter = filter_of(record);
  const Vec3d& start = record.start.position;
  const auto path = [&] { return narrow_phase::Ray::along(start, record.displacement); };
  const auto shape = [&] { return narrow_phase::QueryShape{shapes, record.shape, record.start.orientation}; };
  queries::ObjectHit best;
  found_.clear();
  switch (static_cast<QueryKind>(record.kind)) {
    case QueryKind::cast:
      part.cast(moment, path(), filter, best, work);
      break;
    case QueryKind::cast_any:
      if (part.cast_any(moment, path(), filter, work)) {
        hits.emplace_back().query = query;
      }
      return;
    case QueryKind::cast_all:
      part.cast_all(moment, path(), filter, found_, work);
      break;
    case QueryKind::sweep:
      part.sweep(moment, shape(), path(), filter, best, work);
      break;
    case QueryKind::sweep_all:
      part.sweep_all(moment, shape(), path(), filter, found_, work);
      break;
    case QueryKind::overlap:
      part.overlap(moment, shape(), start, filter, found_, work);
      break;
    case QueryKind::nearest: {
      queries::ObjectPoint nearest;
      part.nearest(moment, start, record.distance, filter, nearest, work);
      if (nearest.object != nullptr) {
        hits.push_back(record_of(query, nearest));
      }
      return;
    }
  }
  if (best.object != nullptr) {
    hits.push_back(record_of(query, best));
  }
  for (const queries::ObjectHit& found : found_) {
    hits.push_back(record_of(query, found));
  }
}

}  // namespace ringfence::nodes
