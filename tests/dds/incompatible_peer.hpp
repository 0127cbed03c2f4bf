#pragma once

#include <cstdint>
#include <utility>

#include "dds/wire.hpp"

namespace ringfence::test {

/// In what the process is incompatible.
enum class Difference : std::uint32_t { none, version, order, layout };
inline constexpr Difference differences[] = {Difference::version, Difference::order, Difference::layout};

/// Changes a Presence or Terms as if it came from another version or machine.
template <class Sample>
void make_incompatible(Sample& sample, Difference difference) {
  switch (difference) {
    case Difference::none:
      break;
    case Difference::version:
      sample.version += 1;
      break;
    case Difference::order:
      std::swap(sample.order[0], sample.order[3]);
      std::swap(sample.order[1], sample.order[2]);
      break;
    case Difference::layout:
      sample.layout += 1;
      break;
  }
}

}  // namespace ringfence::test
