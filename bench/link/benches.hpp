#pragma once

namespace ringfence::bench {

/// Each function registers the benchmarks of one file.
void register_rings();
void register_doorbells();
void register_messages();

}  // namespace ringfence::bench
