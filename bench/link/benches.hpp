#pragma once

namespace ringfence::bench {

/// Each registers its benchmarks by name.
void register_rings();
void register_doorbells();
void register_publications();
void register_messages();

}  // namespace ringfence::bench
