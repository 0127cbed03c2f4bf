#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/shape_view.hpp"
#include "messages/records.hpp"
#include "queries/searcher.hpp"
#include "ringfence/query.hpp"

namespace ringfence::nodes {

/// Answers queries about a part of a frame, as records.
///
/// Threads: belongs to one role. Memory: grows to the largest call.
class QueryAnswers {
 public:
  /// Appends what the queries `records[first]` to `records[end - 1]` find in `part`, lists in any order.
  /// `slots`: those of the objects by row of the part. Precondition: the records are valid, and `shapes` has their
  /// shapes.
  void add(const queries::FramePart& part, std::span<const std::uint32_t> slots, const geometry::ShapeView& shapes,
           std::span<const messages::QueryRecord> records, std::size_t first, std::size_t end,
           std::vector<messages::QueryHitRecord>& hits, QueryWork& work);

 private:
  void add_kind(const queries::FramePart& part, std::span<const std::uint32_t> slots,
                const queries::FrameMoment& moment, messages::QueryKind kind,
                std::span<const messages::QueryRecord> records, std::uint32_t first,
                std::vector<messages::QueryHitRecord>& hits, QueryWork& work);

  queries::Searcher searcher_;
  std::vector<queries::AskedRay> rays_;
  std::vector<queries::AskedShape> shapes_;
  std::vector<queries::AskedPoint> points_;
  std::vector<queries::ObjectHit> best_;
  std::vector<queries::ObjectPoint> nearest_;
  base::FlatList<bool> any_;
};

}  // namespace ringfence::nodes
