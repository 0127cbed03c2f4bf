#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "link/ring.hpp"

namespace ringfence::link {

/// Private memory of a writer in which small messages are put together, so that the ring is written in whole cache
/// lines: a copy of kilobytes stores whole lines, and a line whose old contents are not needed costs half as much to
/// write while another core holds it.
///
/// Holds the bytes of the ring from begin() to a later position, at the same offsets within cache lines. Knows no
/// messages. Empty memory: no message is staged. Threads: as the writer. Allocates nothing.
template <class Policy>
class MessageStage {
 public:
  /// `memory` is empty or whole cache lines, and outlives the stage.
  explicit MessageStage(std::span<std::byte> memory) noexcept : memory_(memory) {}

  /// Size in bytes of the longest message that fits into a stage with `memory` bytes, wherever it starts; 0: none does.
  static constexpr std::size_t largest_message_of(std::size_t memory) noexcept {
    return memory - std::min(memory, RunHeader::bytes + lines.line);
  }

  /// Position of the first byte that is in the stage and not in the ring.
  std::uint64_t begin() const noexcept { return begin_; }

  /// Empties the stage: what follows is staged from `position` on.
  void start_at(std::uint64_t position) noexcept {
    begin_ = position;
    // Positions sizeof(header) above a multiple of the line size are at the start of a line of the ring.
    first_line_ = position - (position - RunHeader::bytes) % lines.line;
  }

  /// The position up to which bytes fit.
  std::uint64_t end() const noexcept { return first_line_ + memory_.size(); }

  /// Where the byte at `position` is staged.
  std::byte* at(std::uint64_t position) const noexcept { return memory_.data() + (position - first_line_); }

  /// Copies what is staged up to `end` to `ring`, where the byte at begin() belongs, and starts at `end`.
  void copy_to(std::byte* ring, std::uint64_t end) noexcept {
    Policy::copy(ring, at(begin_), static_cast<std::size_t>(end - begin_));
    start_at(end);
  }

 private:
  static constexpr CacheLineTuning lines = Policy::lines;

  std::span<std::byte> memory_;
  std::uint64_t begin_ = 0;
  std::uint64_t first_line_ = 0;  ///< position of the first byte of memory_
};

}  // namespace ringfence::link
