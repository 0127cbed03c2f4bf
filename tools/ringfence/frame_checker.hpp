#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "queries/frame_answers.hpp"
#include "reference/frame_check.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Checks the result of each frame, and prints differences on standard error.
///
/// Always checks the counters: each candidate is tested and its result accepted exactly once. With brute force it also
/// compares all contacts and phases, and answers to queries, with those of the reference in double precision.
class FrameChecker {
 public:
  /// `world` must outlive the checker. Shapes that are registered later are checked too.
  FrameChecker(const World& world, bool brute_force);

  /// To be called after a warm-up frame. Checks counters only.
  void skip_frame();
  /// To be called after a counted frame. `frame` is its number in messages.
  void check_frame(std::uint64_t frame);
  /// To be called after check_frame, with the queries about that frame and their answers. With brute force it compares
  /// those of every frame, or of every n-th frame where all would take too long: n is the number of queries times that
  /// of the objects, divided by 2 * 10^7. Answers about earlier frames are compared with what these were; those about
  /// the time between two frames are not compared.
  void check_answers(std::uint64_t frame, std::span<const worlds::QueryRow> rows, const FrameAnswers& answers);

  bool brute_force() const noexcept { return brute_force_; }
  bool passed() const noexcept { return differences_ == 0 && miscounted_ == 0; }
  std::uint64_t frames() const noexcept { return frames_; }  ///< frames compared with brute force
  std::uint64_t differences() const noexcept { return differences_; }
  std::uint64_t miscounted() const noexcept { return miscounted_; }            ///< frames with wrong counters
  std::uint64_t answers() const noexcept { return answers_; }                  ///< answers compared with brute force
  std::uint64_t answered_frames() const noexcept { return answered_frames_; }  ///< frames of these answers

 private:
  void check_counters();
  const std::vector<reference::FrameObject>* objects_asked(std::uint64_t frame, const worlds::QueryRow& row) const;
  void print_difference(const std::string& text);
  void print_differences(const std::vector<reference::Difference>& differences);

  const World& world_;
  bool brute_force_;
  reference::Shapes shapes_;
  std::vector<std::uint32_t> layer_masks_;
  std::vector<reference::FrameObject> objects_;  ///< of the last frame that was compared with brute force
  /// The same of the frames before it that queries can ask about, by counted frame.
  std::map<std::uint64_t, std::vector<reference::FrameObject>> history_;
  std::vector<Contact> before_;
  std::uint64_t frames_ = 0;
  std::uint64_t differences_ = 0;
  std::uint64_t miscounted_ = 0;
  std::uint64_t answers_ = 0;
  std::uint64_t answered_frames_ = 0;
};

}  // namespace ringfence::tools
