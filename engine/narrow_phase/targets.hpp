#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace ringfence::narrow_phase {

/// The instruction sets that the kernels were built for and this machine can run, best first; the last is plain C++
/// without intrinsics. Names are Highway's in lower case: "avx3_dl" (AVX-512 as from Ice Lake on; kernels of hulls
/// only), "avx3" (AVX-512), "avx2", "sse4", "neon", "emu128".
std::vector<std::string> targets();

/// For tests and measurements: makes every Highway kernel of the process run on `name`, one of `targets()`; empty
/// gives the choice back. Not while another thread runs a kernel. Throws ringfence::Error on an unknown name.
void force_target(std::string_view name);

}  // namespace ringfence::narrow_phase
