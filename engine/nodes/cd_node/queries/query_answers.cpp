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

QueryHitRecord record_of(std::uint32_t query, std::uint32_t slot, const narrow_phase::ShapeHit& hit) noexcept {
  return {query, slot, hit.child, hit.triangle, hit.fraction, hit.point, hit.normal};
}

QueryHitRecord record_of(std::uint32_t query, std::uint32_t slot, const narrow_phase::NearestPoint& nearest) noexcept {
  return {query, slot, nearest.child, nearest.triangle, nearest.distance, nearest.point, {}};
}

queries::AskedRay ray_of(const QueryRecord& record) noexcept {
  return {narrow_phase::Ray::along(record.start.position, record.displacement), filter_of(record)};
}

/// The slots of objects of a part.
struct SlotOf {
  const queries::FramePart& part;
  std::span<const std::uint32_t> slots;  ///< by row

  std::uint32_t operator()(const queries::FrameObject& object) const noexcept { return slots[part.row(object)]; }
};

/// Appends the lists of a batch as records; `first` is the number of its first query.
class RecordSink final : public queries::ListSink {
 public:
  RecordSink(const SlotOf& slot_of, std::uint32_t first, std::vector<QueryHitRecord>& hits)
      : slot_of_(slot_of), first_(first), hits_(hits) {}
  void add(std::uint32_t query, std::span<const queries::ObjectHit> found) override {
    for (const queries::ObjectHit& hit : found) {
      hits_.push_back(record_of(first_ + query, slot_of_(*hit.object), hit.hit));
    }
  }

 private:
  const SlotOf& slot_of_;
  std::uint32_t first_;
  std::vector<QueryHitRecord>& hits_;
};

}  // namespace

void QueryAnswers::add(const queries::FramePart& part, std::span<const std::uint32_t> slots,
                       const geometry::ShapeView& shapes, std::span<const QueryRecord> records, std::size_t first,
                       std::size_t end, std::vector<QueryHitRecord>& hits, QueryWork& work) {
  const queries::FrameMoment moment{shapes};
  while (first != end) {
    const std::uint32_t kind = records[first].kind;
    std::size_t last = first + 1;
    while (last != end && records[last].kind == kind) {
      ++last;
    }
    add_kind(part, slots, moment, static_cast<QueryKind>(kind), records.subspan(first, last - first),
             static_cast<std::uint32_t>(first), hits, work);
    first = last;
  }
}

void QueryAnswers::add_kind(const queries::FramePart& part, std::span<const std::uint32_t> slots,
                            const queries::FrameMoment& moment, QueryKind kind, std::span<const QueryRecord> records,
                            std::uint32_t first, std::vector<QueryHitRecord>& hits, QueryWork& work) {
  const bool of_ray = kind == QueryKind::cast || kind == QueryKind::cast_any || kind == QueryKind::cast_all;
  const bool of_point = kind == QueryKind::nearest;
  rays_.clear();
  shapes_.clear();
  points_.clear();
  const SlotOf slot_of{part, slots};
  RecordSink listed(slot_of, first, hits);
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
          hits.push_back(record_of(first + i, slot_of(*nearest_[i].object), nearest_[i].nearest));
        }
      }
      break;
  }
  for (std::uint32_t i = 0; i < best_.size(); ++i) {
    if (best_[i].object != nullptr) {
      hits.push_back(record_of(first + i, slot_of(*best_[i].object), best_[i].hit));
    }
  }
}

}  // namespace ringfence::nodes
