#include "nodes/cd_node/queries/query_answers.hpp"

#include <algorithm>

namespace ringfence::nodes {
namespace {

using messages::QueryHitRecord;
using messages::QueryKind;
using messages::QueryRecord;

QueryFilter filter_of(const QueryRecord& record) noexcept {
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

queries::AskedRay ray_of(const QueryRecord& record) noexcept {
  return {narrow_phase::Ray::along(record.start.position, record.displacement), filter_of(record)};
}

/// Appends the lists of a batch as records; `first` is the number of its first query.
class RecordSink final : public queries::ListSink {
 public:
  RecordSink(std::uint32_t first, std::vector<QueryHitRecord>& hits) : first_(first), hits_(hits) {}
  void add(std::uint32_t query, std::span<const queries::ObjectHit> found) override {
    for (const queries::ObjectHit& hit : found) {
      hits_.push_back(record_of(first_ + query, hit));
    }
  }

 private:
  std::uint32_t first_;
  std::vector<QueryHitRecord>& hits_;
};

}  // namespace

void QueryAnswers::add(const queries::FramePart& part, const geometry::ShapeView& shapes,
                       std::span<const QueryRecord> records, std::size_t first, std::size_t end,
                       std::vector<QueryHitRecord>& hits, QueryWork& work) {
  const queries::FrameMoment moment{shapes};
  while (first != end) {
    const std::uint32_t kind = records[first].kind;
    std::size_t last = first + 1;
    while (last != end && records[last].kind == kind) {
      ++last;
    }
    add_kind(part, moment, static_cast<QueryKind>(kind), records.subspan(first, last - first),
             static_cast<std::uint32_t>(first), hits, work);
    first = last;
  }
}

void QueryAnswers::add_kind(const queries::FramePart& part, const queries::FrameMoment& moment, QueryKind kind,
                            std::span<const QueryRecord> records, std::uint32_t first,
                            std::vector<QueryHitRecord>& hits, QueryWork& work) {
  const bool of_ray = kind == QueryKind::cast || kind == QueryKind::cast_any || kind == QueryKind::cast_all;
  const bool of_point = kind == QueryKind::nearest;
  rays_.clear();
  shapes_.clear();
  points_.clear();
  RecordSink listed(first, hits);
  for (const QueryRecord& record : records) {
    const Vec3d& start = record.start.position;
    if (of_ray) {
      rays_.push_back(ray_of(record));
    } else if (of_point) {
      points_.push_back({start, record.distance, filter_of(record)});
    } else {
      const queries::AskedRay path = ray_of(record);
      shapes_.push_back({{moment.shapes, record.shape, record.start.orientation}, path.ray, path.filter});
    }
  }
  best_.assign(of_point ? 0 : records.size(), {});
  switch (kind) {
    case QueryKind::cast:
      searcher_.cast(part, moment, rays_, best_, work);
      break;
    case QueryKind::cast_any:
      any_.resize(records.size());
      std::fill(any_.begin(), any_.end(), false);
      searcher_.cast_any(part, moment, rays_, {any_.data(), any_.size()}, work);
      for (std::uint32_t i = 0; i < records.size(); ++i) {
        if (any_[i]) {
          hits.emplace_back().query = first + i;
        }
      }
      break;
    case QueryKind::cast_all:
      searcher_.cast_all(part, moment, rays_, listed, work);
      break;
    case QueryKind::sweep:
      searcher_.sweep(part, moment, shapes_, best_, work);
      break;
    case QueryKind::sweep_all:
      searcher_.sweep_all(part, moment, shapes_, listed, work);
      break;
    case QueryKind::overlap:
      searcher_.overlap(part, moment, shapes_, listed, work);
      break;
    case QueryKind::nearest:
      nearest_.assign(records.size(), {});
      searcher_.nearest(part, moment, points_, nearest_, work);
      for (std::uint32_t i = 0; i < records.size(); ++i) {
        if (nearest_[i].object != nullptr) {
          hits.push_back(record_of(first + i, nearest_[i]));
        }
      }
      break;
  }
  for (std::uint32_t i = 0; i < best_.size(); ++i) {
    if (best_[i].object != nullptr) {
      hits.push_back(record_of(first + i, best_[i]));
    }
  }
}

}  // namespace ringfence::nodes
