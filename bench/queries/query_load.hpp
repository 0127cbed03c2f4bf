#pragma once

namespace ringfence::bench {

/// Registers the benchmarks of queries under load: on two threads, beside frames, after many spawns and destroys, and
/// about a history.
void register_query_loads();

}  // namespace ringfence::bench
