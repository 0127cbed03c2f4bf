#include "dds/node_totals.hpp"

namespace ringfence::dds {

void NodeTotals::add_frame(const messages::NodeFrameStats& frame) noexcept {
  frames_.fetch_add(1, std::memory_order_relaxed);
  objects_.store(frame.hosted, std::memory_order_relaxed);
  handed_over_.fetch_add(frame.handed_over, std::memory_order_relaxed);
  frame_busy_ns_.store(frame.busy_ns, std::memory_order_relaxed);
  cpu_ns_.fetch_add(frame.cpu_ns, std::memory_order_relaxed);
}

NodeServiceReport NodeTotals::report() const noexcept {
  NodeServiceReport report;
  report.serves = serves_.load(std::memory_order_relaxed);
  report.frames = frames_.load(std::memory_order_relaxed);
  report.objects = report.serves ? objects_.load(std::memory_order_relaxed) : 0;
  report.handed_over = handed_over_.load(std::memory_order_relaxed);
  report.frame_busy_s = static_cast<double>(frame_busy_ns_.load(std::memory_order_relaxed)) * 1e-9;
  report.cpu_s = static_cast<double>(cpu_ns_.load(std::memory_order_relaxed)) * 1e-9;
  return report;
}

}  // namespace ringfence::dds
