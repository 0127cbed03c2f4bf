#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "options.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/world.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// A world to run, wherever it comes from.
struct Job {
  std::string title;  ///< for the report: what is run
  worlds::Scene scene;
  std::shared_ptr<const MotionModel> model;
  std::vector<std::byte> motion_setup;  ///< the model as bytes, where nodes are processes
  FrameOptions frames;
  ServiceOptions service;
  OutputOptions output;
  std::string record_prefix;                         ///< empty: nothing is recorded
  bool profile = false;                              ///< the report is about the narrow phase
  const worlds::PaperWorldOptions* world = nullptr;  ///< its parameters, if it is the paper's
};

/// Generates the paper's world. `options` outlives the job. Throws Error.
Job make_job(const RunOptions& options);

/// Reads scene and motion. Throws Error, InputError.
Job make_job(const ReplayOptions& options);

/// What a World for the job is made of; the scene is still to be loaded into it.
WorldConfig world_config(const Job& job);

/// One frame. `frame` is its number in messages. Throws IncompleteError when it is refused.
void advance(World& world, std::uint64_t frame);

/// Runs all frames, with everything that the output options ask for, and prints the report. Answers the exit code.
/// Throws Error for bad use, IncompleteError when the run cannot be completed.
int run_job(const Job& job);

}  // namespace ringfence::tools
