#pragma once

#include <cstdint>

#include "nodes/server/server_role.hpp"
#include "queries/recorded_frame.hpp"

namespace ringfence::facade {

/// Records the present objects after the last frame of the server. Between frames, on the thread that calls World.
/// Allocates only if the frame has more slots than any that `frame` had before. May throw std::bad_alloc; then the
/// number of `frame` is RecordedFrame::none.
void record_frame(const nodes::ServerRole& server, std::uint64_t number, queries::RecordedFrame& frame);

}  // namespace ringfence::facade
