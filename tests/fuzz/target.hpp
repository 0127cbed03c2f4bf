#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>

/// Checks the property of the fuzz target on one input. libFuzzer calls it with generated inputs, and replay_main.cpp
/// with each file of the committed corpus. Aborts the program if the property does not hold; otherwise returns 0.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size);

namespace ringfence::fuzz {

/// Aborts the program unless `holds`.
inline void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace ringfence::fuzz
