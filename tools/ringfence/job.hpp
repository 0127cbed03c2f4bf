#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "options.hpp"
#include "queries/query_load.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/world.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Everything that a run needs, whether the world is generated or read from files.
struct Job {
  std::string title;  ///< first line of the report
  worlds::Scene scene;
  std::size_t objects = 0;  ///< of the scene; set by run_job(), which frees the list when the world has them
  std::shared_ptr<const MotionModel> model;
  std::vector<std::byte> motion_setup;  ///< see pack_motion; empty unless CD nodes are processes
  FrameOptions frames;
  ServiceOptions service;
  OutputOptions output;
  JournalOptions journal;
  QueryLoad queries;
  ViewOptions view;
  std::string record_prefix;                         ///< empty: no recording
  bool profile = false;                              ///< print the profile of the narrow phase instead of the report
  const worlds::PaperWorldOptions* world = nullptr;  ///< parameters of a generated world; null for a replay
};

/// Generates the paper's world. `options` must outlive the job. Throws Error for invalid options.
Job make_job(const RunOptions& options);

/// Reads a scene and its motion. Throws InputError for invalid files and Error for invalid options.
Job make_job(const ReplayOptions& options);

/// Configuration of a World for the job. The caller loads the scene into the world.
WorldConfig world_config(const Job& job);

/// Advances `world` by one frame. `frame` is its number in messages. Throws IncompleteError if the world refuses.
void advance(World& world, std::uint64_t frame);

/// Runs all frames, writes all outputs and prints the report. SIGINT and SIGTERM end the run after the frame that they
/// arrive in; its outputs and report are complete for the frames before. Returns the exit code. Throws Error for
/// invalid options, and IncompleteError if the run cannot be completed.
int run_job(Job job);

}  // namespace ringfence::tools
