#include "progress.hpp"

#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

namespace ringfence::tools {

Progress::Progress(bool quiet, std::uint64_t steps) : shown_(!quiet && isatty(STDERR_FILENO) == 1), steps_(steps) {}

void Progress::step() {
  ++at_;
  if (!shown_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  fmt::print(stderr, "\rframe {} of {}", at_, steps_);
  std::fflush(stderr);
}

void Progress::finish() {
  if (!shown_) return;
  shown_ = false;
  fmt::print(stderr, "\r\x1b[K");
  std::fflush(stderr);
}

}  // namespace ringfence::tools
