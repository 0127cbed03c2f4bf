#pragma once

#include <cstdint>

#include "nodes/server/server_role.hpp"
#include "queries/recorded_frame.hpp"

namespace ringfence::facade {

/// Records the present objects after the last frame of the server. Between frames, on the thread that calls World.
/// `with_bounds`: their bounds too, so that the first query of the frame waits half as long for the index.
/// Allocates only if the frame has more slots than any that `frame` had before. May throw std::bad_alloc; then the
/// number of `frame` is RecordedFrame::none.
void record_frame(const nodes::ServerRole& server, std::uint64_t number, bool with_bounds,
                  queries::RecordedFrame& frame);

}  // namespace ringfence::facade
