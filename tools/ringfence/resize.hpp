#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "ringfence/frame_report.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Change to `nodes` CD nodes in counted frame `frame`.
struct Resize {
  std::uint32_t frame = 0;
  std::uint32_t nodes = 0;
};

/// Parses the value of --resize: "FRAME:N", or several separated by commas. N is 1 to 1024. Throws Error that states
/// the expected form.
std::vector<Resize> parse_resizes(std::string_view text);

/// Sorts by frame. Throws Error unless each frame is below `frames` and occurs once.
void check_resizes(std::vector<Resize>& resizes, std::uint32_t frames);

/// Cost of the frames around one resize. New nodes join in frame `frame`, and objects are handed over at its end. In
/// the next frame each node receives all objects of its region again.
struct ResizeFigures {
  std::uint32_t frame = 0;
  std::uint32_t from = 0, to = 0;  ///< numbers of nodes
  struct Around {
    double before = 0;  ///< mean of up to eight frames before the resize
    double at = 0;      ///< frame of the resize
    double next = 0;    ///< next frame
    double after = 0;   ///< mean of up to eight frames after the next frame
  };
  Around frame_ms, contacts;      ///< 0 where there is no such frame
  std::uint64_t handed_over = 0;  ///< objects whose host changed at the end of the frame
};

/// Applies the resizes of --resize to a world and measures the frames around each.
class ResizeSchedule {
 public:
  /// `resizes` must have passed check_resizes and outlive the schedule. `nodes` is the initial number of nodes.
  ResizeSchedule(const std::vector<Resize>& resizes, std::uint32_t nodes) : resizes_(resizes), nodes_(nodes) {}

  /// To be called before counted frame `frame`. Throws Error if the world refuses a resize.
  void before_frame(std::uint32_t frame, World& world);
  /// To be called after each counted frame.
  void add_frame(const FrameReport& report);

  /// One entry for each resize that was applied, sorted by frame.
  std::vector<ResizeFigures> figures() const;

 private:
  struct Frame {
    double ms;
    std::uint64_t contacts, handed_over;
  };
  const std::vector<Resize>& resizes_;
  std::uint32_t nodes_;
  std::size_t next_ = 0;       ///< index in resizes_ of the next resize
  std::vector<Frame> frames_;  ///< all counted frames; empty without resizes
};

}  // namespace ringfence::tools
