#include "facade/queries/query_order.hpp"

#include <algorithm>

namespace ringfence::facade {
namespace {

constexpr double cells = 128;  // by axis

/// The lowest seven bits, with two bits of 0 between any two.
constexpr std::uint32_t spread(std::uint32_t bits) noexcept {
  bits = (bits | bits << 8) & 0x0300f00fu;
  bits = (bits | bits << 4) & 0x030c30c3u;
  return (bits | bits << 2) & 0x09249249u;
}

std::uint32_t cell_of(double value, double lower, double upper) noexcept {
  const double place = (value - lower) / (upper - lower) * cells;
  return place > 0 ? static_cast<std::uint32_t>(std::min(place, cells - 1)) : 0;  // 0 for NaN
}

}  // namespace

// Along a Morton curve.
template <class Query, class Start>
void QueryOrder::sort(std::span<const Query> queries, Start start) {
  sort_.reserve(queries.size());
  if (queries.empty()) return;
  Vec3d min = start(queries[0]), max = min;
  for (const Query& query : queries) {
    const Vec3d& at = start(query);
    min = {std::min(min.x, at.x), std::min(min.y, at.y), std::min(min.z, at.z)};
    max = {std::max(max.x, at.x), std::max(max.y, at.y), std::max(max.z, at.z)};
  }
  for (const Query& query : queries) {
    const Vec3d& at = start(query);
    sort_.add(spread(cell_of(at.x, min.x, max.x)) | spread(cell_of(at.y, min.y, max.y)) << 1 |
              spread(cell_of(at.z, min.z, max.z)) << 2);
  }
  sort_.sort();
}

QueryOrder::QueryOrder(std::span<const RayQuery> queries) {
  sort(queries, [](const RayQuery& query) { return query.start; });
}
QueryOrder::QueryOrder(std::span<const SweepQuery> queries) {
  sort(queries, [](const SweepQuery& query) { return query.start.position; });
}
QueryOrder::QueryOrder(std::span<const OverlapQuery> queries) {
  sort(queries, [](const OverlapQuery& query) { return query.pose.position; });
}
QueryOrder::QueryOrder(std::span<const NearestQuery> queries) {
  sort(queries, [](const NearestQuery& query) { return query.point; });
}

}  // namespace ringfence::facade
