#pragma once

#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "figures.hpp"
#include "frame_checker.hpp"
#include "job.hpp"
#include "output_file.hpp"
#include "resize.hpp"

namespace ringfence::tools {

/// Key of a kind of traffic in the JSON report: m1 to m5, states, control.
constexpr const char* name_of_traffic(Traffic kind) {
  constexpr const char* names[] = {"m1", "m2", "m3", "m4", "m5", "states", "control"};
  return names[static_cast<std::size_t>(kind)];
}

/// The value of `machine` in JSON reports.
nlohmann::ordered_json machine_json();

/// How many frames were counted, and the signal if one has ended the run, for example "600 frames counted after 60 of
/// warm-up".
std::string counted_frames(const Job& job, const Figures& figures);

/// The requested placement and, if that is automatic, the one that the World chose, for example "auto (region)".
std::string placement_of(const ServiceOptions& service, const Figures& figures);

/// Prints the report of a run as text.
void print_report(std::FILE* out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                  const FrameChecker& checker);

/// Writes the JSON report of a run (--json).
void write_json_report(OutputFile& out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                       const FrameChecker& checker);

/// The value of `cluster` in the JSON report and in the status file.
nlohmann::ordered_json cluster_json(const dds::ClusterReport& cluster);

}  // namespace ringfence::tools
