#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

/// Checks the property of the fuzz target on one input. libFuzzer calls it with generated inputs, and replay_main.cpp
/// with each file of the committed corpus. Aborts the program if the property does not hold; otherwise returns 0.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size);

namespace ringfence::fuzz {

/// Aborts the program unless `holds`, and says where.
inline void require(bool holds, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (holds) return;
  std::fprintf(stderr, "%s:%d: the property does not hold\n", file, line);
  std::abort();
}

}  // namespace ringfence::fuzz
