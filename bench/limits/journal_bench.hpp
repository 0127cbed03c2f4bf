#pragma once

namespace ringfence::bench {

/// Registers limit/journal/<objects>/<sync>: CPU time of the thread that calls a World with a journal and steps all its
/// roles, in which 1000 users move their avatars in every frame, beside the same world without a journal; the two run
/// alternately. `cpu` is the ratio of the medians, `bytes` the size of the inputs in the journal over that of the moves
/// themselves: user, number and pose.
void add_journal_benchmarks();

}  // namespace ringfence::bench
