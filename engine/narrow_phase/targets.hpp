#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace ringfence::narrow_phase {

/// The instruction sets for which the kernels are compiled and which this machine supports, best first; the last is
/// plain C++ without intrinsics. The names are Highway's in lower case: "avx3_dl" (AVX-512 of Ice Lake and later),
/// "avx3" (AVX-512), "avx2", "sse4", "neon", "emu128".
std::vector<std::string> targets();

/// For tests and benchmarks: makes every Highway kernel of the process use the target `name`, one of `targets()`. An
/// empty name restores the default. Must not be called while another thread runs a kernel. Throws ringfence::Error for
/// an unknown name.
void force_target(std::string_view name);

}  // namespace ringfence::narrow_phase
