#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace ringfence::tools {

/// A progress line on standard error with the estimated time left. It is shown only on a terminal and updated at most
/// ten times a second.
class Progress {
 public:
  Progress(bool quiet, std::uint64_t steps);
  ~Progress() { finish(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Sets the text of the line; without it the line counts frames.
  void set_text(std::string text) { text_ = std::move(text); }
  void step(std::uint64_t steps = 1);
  /// Clears the line. Later steps show nothing.
  void finish();

 private:
  bool shown_;
  std::uint64_t steps_;
  std::uint64_t at_ = 0;
  std::string text_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point next_;
};

/// Text for the estimated time left, for example ", 10 s left"; empty in the first second. `share_done` is 0 to 1.
std::string time_left(double elapsed_s, double share_done);

}  // namespace ringfence::tools
