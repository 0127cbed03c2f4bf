#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>

/// What libFuzzer calls, and replay_main.cpp for every file of the committed corpus: one run on one input. Ends the
/// program where a property does not hold. Always returns 0.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size);

namespace ringfence::fuzz {

/// A property that has to hold whatever the input is.
inline void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace ringfence::fuzz
