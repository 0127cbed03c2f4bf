#include "nodes/findings.hpp"

#include <utility>

namespace ringfence::nodes {

void Findings::start(std::uint64_t new_frame) {
  if (frame != new_frame) {
    std::swap(keys, keys_before);
    std::swap(found, found_before);
    std::swap(outer, outer_before);
    frame_before = std::exchange(frame, new_frame);
  }
  keys.clear();
  found.clear();
  begun.clear();
  beginnings = 0;
  border_beginning.clear();
  ending.clear();
  border_ending.clear();
  outer.clear();
  outer_ending.clear();
  for_peers.clear();
}

}  // namespace ringfence::nodes
