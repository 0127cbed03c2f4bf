#pragma once

#include <atomic>
#include <cstdint>

#include "messages/records.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::dds {

/// What a node process has done, for NodeService::report().
///
/// Threads: one writes; any may read. The values of a report may be of different frames.
class NodeTotals {
 public:
  void set_serves(bool serves) noexcept { serves_.store(serves, std::memory_order_relaxed); }
  void add_frame(const messages::NodeFrameStats& frame) noexcept;
  NodeServiceReport report() const noexcept;

 private:
  std::atomic<bool> serves_{false};
  std::atomic<std::uint64_t> frames_{0}, objects_{0}, handed_over_{0}, frame_busy_ns_{0}, cpu_ns_{0};
};

}  // namespace ringfence::dds
