#include "nodes/exchange/host_owned_states.hpp"

#include <cstring>

#include "base/stream_lines.hpp"

namespace ringfence::nodes {

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
  const HostOwnedState added{object, pose};
  base::stream_lines(std::span(&added, 1), &edition.objects.add());
  if (state_bytes_ != 0) {
    const std::size_t at = edition.states.size();
    edition.states.resize(at + state_bytes_);
    std::memcpy(edition.states.data() + at, state, state_bytes_);
  }
}

void HostOwnedStates::finish() const noexcept { base::finish_streams(); }

}  // namespace ringfence::nodes
