#include "progress.hpp"

#include <cmath>
#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

namespace ringfence::tools {

Progress::Progress(bool quiet, std::uint64_t steps) : shown_(!quiet && isatty(STDERR_FILENO) == 1), steps_(steps) {}

void Progress::step(std::uint64_t steps) {
  at_ += steps;
  if (!shown_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  const std::string what = text_.empty() ? fmt::format("frame {} of {}", at_, steps_) : text_;
  fmt::print(stderr, "\r{}{}\x1b[K", what,
             time_left(elapsed_s, steps_ > 0 ? static_cast<double>(at_) / static_cast<double>(steps_) : 0));
  std::fflush(stderr);
}

void Progress::finish() {
  if (!shown_) return;
  shown_ = false;
  fmt::print(stderr, "\r\x1b[K");
  std::fflush(stderr);
}

std::string time_left(double elapsed_s, double share_done) {
  if (elapsed_s < 1 || !(share_done > 0)) return {};
  const double left = std::ceil(elapsed_s * (1 - std::fmin(share_done, 1)) / share_done);
  if (left < 100) return fmt::format(", {:.0f} s left", left);
  return fmt::format(", {:.0f} min left", std::ceil(left / 60));
}

}  // namespace ringfence::tools
