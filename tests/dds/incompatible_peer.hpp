#pragma once

#include <cstdint>
#include <utility>

#include "dds/release.hpp"
#include "dds/wire.hpp"

namespace ringfence::test {

/// In what the process is incompatible.
enum class Difference : std::uint32_t { none, version, order, layout, release, world };
/// A release with the same record layout as this one.
inline constexpr const char* other_release = "9.8.7 (bits 6)";
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
    case Difference::release:
      sample.layout = dds::fingerprint(other_release);
      break;
    case Difference::world:
      sample.world += 1;
      break;
  }
}

}  // namespace ringfence::test
