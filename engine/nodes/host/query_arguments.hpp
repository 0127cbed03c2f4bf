#pragma once

#include "queries/recorded_frame.hpp"
#include "queries/searcher.hpp"
#include "ringfence/query.hpp"

namespace ringfence::nodes {

// What the arguments of a query become for the engine. Each function checks them for the frame that the query asks
// about, and returns what Hit::status says; its result is set only with ok. Any thread may call them.

Status check(const RayQuery& query, const queries::RecordedFrame& frame, queries::AskedRay& asked) noexcept;
Status check(const SweepQuery& query, const queries::RecordedFrame& frame, queries::AskedShape& asked) noexcept;
Status check(const OverlapQuery& query, const queries::RecordedFrame& frame, queries::AskedShape& asked) noexcept;
Status check(const NearestQuery& query, const queries::RecordedFrame& frame, queries::AskedPoint& asked) noexcept;

}  // namespace ringfence::nodes
