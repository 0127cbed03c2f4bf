#include "nodes/exchange/host_owned_states.hpp"

#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace ringfence::nodes {
namespace {

/// Non-temporal where available. Both are aligned to a cache line.
void write_through(HostOwnedState& to, const HostOwnedState& from) noexcept {
#if defined(__SSE2__)
  const auto* const source = reinterpret_cast<const __m128i*>(&from);
  auto* const target = reinterpret_cast<__m128i*>(&to);
  for (std::size_t i = 0; i < sizeof from / sizeof(__m128i); ++i) {
    _mm_stream_si128(target + i, _mm_load_si128(source + i));
  }
#else
  to = from;
#endif
}

}  // namespace

void HostOwnedStates::reserve(std::size_t objects, std::size_t state_bytes) {
  state_bytes_ = state_bytes;
  for (Edition& edition : editions_) {
    edition.objects.reserve(objects);
    edition.states.reserve(objects * state_bytes);
  }
}

void HostOwnedStates::begin(std::uint64_t frame) noexcept {
  editions_[frame & 1].objects.clear();
  editions_[frame & 1].states.clear();
}

void HostOwnedStates::add(std::uint64_t frame, const messages::ObjectRef& object, const Pose& pose,
                          const std::byte* state) {
  Edition& edition = editions_[frame & 1];
  write_through(edition.objects.add(), {object, pose});
  if (state_bytes_ != 0) {
    const std::size_t at = edition.states.size();
    edition.states.resize(at + state_bytes_);
    std::memcpy(edition.states.data() + at, state, state_bytes_);
  }
}

// Non-temporal stores are not ordered by release stores.
void HostOwnedStates::finish() const noexcept {
#if defined(__SSE2__)
  _mm_sfence();
#endif
}

}  // namespace ringfence::nodes
