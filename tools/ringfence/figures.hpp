#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "imbalance.hpp"
#include "queries/query_figures.hpp"
#include "ringfence/cluster.hpp"
#include "ringfence/config.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::tools {

/// Distribution of a time over all counted frames, in milliseconds.
struct Spread {
  double mean = 0, p50 = 0, p99 = 0, max = 0;
};

/// Means per counted frame of one CD node.
struct NodeFigures {
  std::uint32_t id = 0;  ///< NodeReport::id
  double busy_ms = 0, cpu_ms = 0, wait_ms = 0, move_ms = 0, broad_phase_ms = 0, narrow_phase_ms = 0;
  double candidates = 0, tested = 0, carried = 0, contacts = 0, hosted = 0, handed_over = 0;
};

/// Collects the statistics of a run, frame by frame. Counted frames are those after the warm-up. One thread.
class Figures {
 public:
  void add(const FrameReport& report, std::span<const Contact> contacts);

  std::uint64_t frames() const noexcept { return frame_ms_.size(); }
  std::uint64_t digest() const noexcept { return digest_.value(); }
  /// Continues the digest of a run from `value`. Only before add().
  void continue_digest(std::uint64_t value) noexcept { digest_ = Digest(value); }
  /// Adds a counted frame to the digest alone: it was run again from a journal.
  void add_to_digest(std::span<const Contact> of_frame) noexcept { digest_.add_frame(of_frame); }
  Spread frame_ms() const;
  double stage_ms(Stage stage) const noexcept { return mean(stage_ms_[static_cast<std::size_t>(stage)]); }
  /// Of each node that worked in a counted frame, by id.
  std::vector<NodeFigures> nodes() const;
  /// Totals over the counted frames, sorted by the kinds of the pair.
  const std::vector<KindReport>& kinds() const noexcept { return kinds_; }
  TrafficReport traffic(Traffic kind) const noexcept { return traffic_[static_cast<std::size_t>(kind)]; }
  std::uint64_t refused(Status reason) const noexcept { return refused_[static_cast<std::size_t>(reason)]; }
  /// `total` divided by the number of counted frames; 0 without frames.
  double mean(double total) const noexcept { return frames() == 0 ? 0 : total / static_cast<double>(frames()); }

  /// Totals over the counted frames.
  std::uint64_t candidates = 0, tested = 0, carried = 0, accepted = 0, contacts = 0, began = 0, ended = 0;
  FrameReport totals;                       ///< the fields of FrameReport::counters()
  std::uint64_t objects = 0;                ///< number of objects after the last frame
  Placement placement = Placement::server;  ///< where the broad phase ran
  std::uint64_t map_changes = 0;            ///< number of changes of the region map
  Imbalance cpu_imbalance;                  ///< imbalance of the CPU time of CD nodes
  Imbalance tested_imbalance;               ///< imbalance of the pairs that CD nodes test
  double server_cpu_ms = 0, users_cpu_ms = 0;
  PathReport path;
  double critical_ms = 0;  ///< sum of PathReport::critical_ms over the frames

  /// A node that was lost. Sorted by frame.
  struct Loss {
    std::uint64_t frame = 0;  ///< counted from 0 after the warm-up
    bool user = false;        ///< true: a user node that missed its deadline; false: a CD node
    std::uint32_t node = 0;   ///< its id
    double frame_ms = 0;      ///< duration of the frame in which it was lost
  };
  std::vector<Loss> losses;
  const char* ended_by = nullptr;       ///< the signal that ended the run before all its frames; null if it is complete
  std::optional<QueryFigures> queries;  ///< after the last frame; only if the run has queries
  std::optional<dds::ClusterReport> cluster;  ///< after the last frame; only if CD nodes are processes

 private:
  Digest digest_;
  std::vector<double> frame_ms_;
  std::array<double, stage_count> stage_ms_{};
  std::array<TrafficReport, traffic_count> traffic_{};
  std::array<std::uint64_t, status_count> refused_{};
  std::vector<NodeFigures> node_totals_;  ///< by id
  std::vector<double> values_;
  std::uint32_t map_epoch_ = 0;
  std::vector<KindReport> kinds_;
};

}  // namespace ringfence::tools
