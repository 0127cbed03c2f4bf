#pragma once

#include <cstdio>

#include <nlohmann/json.hpp>

#include "figures.hpp"
#include "frame_checker.hpp"
#include "job.hpp"
#include "output_file.hpp"
#include "resize.hpp"

namespace ringfence::tools {

/// As in the keys of the JSON: m1 to m5, states, control.
constexpr const char* name_of_traffic(Traffic kind) {
  constexpr const char* names[] = {"m1", "m2", "m3", "m4", "m5", "states", "control"};
  return names[static_cast<std::size_t>(kind)];
}

/// This machine, as under `machine` in the JSON.
nlohmann::ordered_json machine_json();

/// The short report that a person reads.
void print_report(std::FILE* out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                  const FrameChecker& checker);

/// --json: all figures.
void write_json_report(OutputFile& out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                       const FrameChecker& checker);

/// What a cluster did, as the JSON of a run and of --status have it.
nlohmann::ordered_json cluster_json(const dds::ClusterReport& cluster);

}  // namespace ringfence::tools
