#include "resize.hpp"

#include <algorithm>
#include <charconv>
#include <ranges>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr std::uint32_t max_nodes = 1024;
constexpr std::size_t frames_around = 8;

}  // namespace

std::vector<Resize> parse_resizes(std::string_view text) {
  std::vector<Resize> resizes;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const std::string_view item = text.substr(begin, comma - begin);
    const char* const end = item.data() + item.size();
    Resize resize;
    const auto [colon, error] = std::from_chars(item.data(), end, resize.frame);
    bool right = error == std::errc() && colon != end && *colon == ':';
    if (right) {
      const auto [stop, second_error] = std::from_chars(colon + 1, end, resize.nodes);
      right = second_error == std::errc() && stop == end && resize.nodes >= 1 && resize.nodes <= max_nodes;
    }
    if (!right) {
      throw Error(fmt::format("found {}; expected FRAME:N with N from 1 to {} CD nodes, several with commas between",
                              item.empty() ? "nothing" : item, max_nodes));
    }
    resizes.push_back(resize);
    begin = comma + 1;
  }
  return resizes;
}

void check_resizes(std::vector<Resize>& resizes, std::uint32_t frames) {
  std::ranges::sort(resizes, {}, &Resize::frame);
  for (std::size_t i = 0; i < resizes.size(); ++i) {
    if (resizes[i].frame >= frames) {
      throw Error(
          fmt::format("--resize: found frame {}; expected 0 to {}, the counted frames", resizes[i].frame, frames - 1));
    }
    if (i > 0 && resizes[i].frame == resizes[i - 1].frame) {
      throw Error(fmt::format("--resize: found frame {} twice; expected each frame once", resizes[i].frame));
    }
  }
}

void ResizeSchedule::before_frame(std::uint32_t frame, World& world) {
  if (next_ == resizes_.size() || resizes_[next_].frame != frame) return;
  const Resize& resize = resizes_[next_++];
  if (const Status status = world.resize(resize.nodes); status != Status::ok) {
    throw Error(fmt::format("--resize: {}:{} was refused ({}); expected at most as many nodes as the world has cells",
                            resize.frame, resize.nodes, name_of(status)));
  }
}

void ResizeSchedule::add_frame(const FrameReport& report) {
  if (!resizes_.empty()) frames_.push_back({report.frame_ms, report.contacts, report.handed_over});
}

std::vector<ResizeFigures> ResizeSchedule::figures() const {
  const auto mean = [this](std::size_t begin, std::size_t end, auto value) {
    end = std::min(end, frames_.size());
    if (begin >= end) return 0.0;
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += static_cast<double>(value(frames_[i]));
    return sum / static_cast<double>(end - begin);
  };
  std::vector<ResizeFigures> all;
  std::uint32_t nodes = nodes_;
  for (const Resize& resize : resizes_) {
    const std::size_t at = resize.frame;
    if (at >= frames_.size()) break;  // the run ended before
    ResizeFigures figures{resize.frame, nodes, resize.nodes, {}, {}, frames_[at].handed_over};
    nodes = resize.nodes;
    const auto mean_around = [&](auto value) {
      return ResizeFigures::Around{mean(at - std::min(at, frames_around), at, value), mean(at, at + 1, value),
                                   mean(at + 1, at + 2, value), mean(at + 2, at + 2 + frames_around, value)};
    };
    figures.frame_ms = mean_around([](const Frame& frame) { return frame.ms; });
    figures.contacts = mean_around([](const Frame& frame) { return frame.contacts; });
    all.push_back(figures);
  }
  return all;
}

}  // namespace ringfence::tools
