#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "ringfence/frame_report.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// In counted frame `frame` there come to be `nodes` CD nodes.
struct Resize {
  std::uint32_t frame = 0;
  std::uint32_t nodes = 0;
};

/// Reads "FRAME:N", or several with commas between them. Throws Error with what is expected; N is 1 to 1024.
std::vector<Resize> parse_resizes(std::string_view text);

/// Throws Error unless each frame is below `frames` and given once. Sorts by frame.
void check_resizes(std::vector<Resize>& resizes, std::uint32_t frames);

/// The frames around one resize. New nodes join frame `frame`; at its end everything is handed over; in the next frame
/// the nodes are told anew of what is in their regions.
struct ResizeFigures {
  std::uint32_t frame = 0;
  std::uint32_t from = 0, to = 0;  ///< nodes
  struct Around {
    double before = 0;  ///< mean of up to eight frames before
    double at = 0;      ///< the frame itself
    double next = 0;    ///< the one after it
    double after = 0;   ///< mean of up to eight frames after that one
  };
  Around frame_ms, contacts;      ///< zero where there was no such frame
  std::uint64_t handed_over = 0;  ///< objects whose host changed at the end of the frame
};

/// Asks a world for the nodes that --resize wants, frame by frame, and keeps what the frames around it cost.
class ResizeSchedule {
 public:
  /// `resizes` are checked; `nodes` are those of the start. Both outlive it.
  ResizeSchedule(const std::vector<Resize>& resizes, std::uint32_t nodes) : resizes_(resizes), nodes_(nodes) {}

  /// Before counted frame `frame`. Throws Error if the world refuses.
  void before_frame(std::uint32_t frame, World& world);
  /// After it.
  void add_frame(const FrameReport& report);

  /// One entry a resize, in order of frames.
  std::vector<ResizeFigures> figures() const;

 private:
  struct Frame {
    double ms;
    std::uint64_t contacts, handed_over;
  };
  const std::vector<Resize>& resizes_;
  std::uint32_t nodes_;
  std::size_t next_ = 0;       ///< in resizes_
  std::vector<Frame> frames_;  ///< empty where nothing is resized
};

}  // namespace ringfence::tools
