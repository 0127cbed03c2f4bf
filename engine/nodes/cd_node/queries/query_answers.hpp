#pragma once

#include <cstdint>
#include <vector>

#include "geometry/shape_view.hpp"
#include "messages/records.hpp"
#include "queries/frame_part.hpp"
#include "ringfence/query.hpp"

namespace ringfence::nodes {

/// Answers single queries about a part of a frame, as records.
///
/// Threads: belongs to one role. Memory: grows to the longest list.
class QueryAnswers {
 public:
  /// Appends what query number `query` finds in `part`, lists in any order. `FrameObject::slot` is the slot of an
  /// object. Precondition: the record is valid, and `shapes` has its shape.
  void add(const queries::FramePart& part, const geometry::ShapeView& shapes, std::uint32_t query,
           const messages::QueryRecord& record, std::vector<messages::QueryHitRecord>& hits, QueryWork& work);

 private:
  std::vector<queries::ObjectHit> found_;
};

}  // namespace ringfence::nodes
