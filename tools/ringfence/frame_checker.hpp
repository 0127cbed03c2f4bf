#pragma once

#include <cstdint>
#include <vector>

#include "reference/frame_check.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Compares frames with brute force, and, in every run, the counters that say that each candidate was tested and its
/// result accepted exactly once. What differs is printed on standard error.
class FrameChecker {
 public:
  /// With `brute_force` false only the counters are looked at. `world` has its shapes.
  FrameChecker(const World& world, bool brute_force);

  /// After a frame that is outside the outputs: counters only.
  void skip_frame();
  /// After a counted frame; `frame` is its number in the outputs.
  void check_frame(std::uint64_t frame);

  bool brute_force() const noexcept { return brute_force_; }
  bool passed() const noexcept { return differences_ == 0 && miscounted_ == 0; }
  std::uint64_t frames() const noexcept { return frames_; }  ///< compared with brute force
  std::uint64_t differences() const noexcept { return differences_; }
  std::uint64_t miscounted() const noexcept { return miscounted_; }  ///< frames

 private:
  void check_counters();
  void print_differences(const std::vector<reference::Difference>& differences);

  const World& world_;
  bool brute_force_;
  reference::Shapes shapes_;
  std::vector<std::uint32_t> layer_masks_;
  std::vector<Contact> before_;
  std::uint64_t frames_ = 0;
  std::uint64_t differences_ = 0;
  std::uint64_t miscounted_ = 0;
};

}  // namespace ringfence::tools
