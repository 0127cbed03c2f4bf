#include "job.hpp"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "frame_checker.hpp"
#include "frame_outputs.hpp"
#include "heap_limits.hpp"
#include "journal_run.hpp"
#include "mesh_file.hpp"
#include "motion_setup.hpp"
#include "node_processes.hpp"
#include "picture/picture_file.hpp"
#include "profile.hpp"
#include "progress.hpp"
#include "queries/frame_queries.hpp"
#include "recording.hpp"
#include "report.hpp"
#include "ringfence/world.hpp"
#include "serve/job_view.hpp"
#include "status_line.hpp"
#include "stop_signals.hpp"
#include "worlds/load.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/query_file.hpp"
#include "worlds/replay_model.hpp"
#include "worlds/scene_file.hpp"

namespace ringfence::tools {
namespace {

/// Checks the options of --link against each other. With --wait-nodes, that is the number of nodes.
void resolve_link(ServiceOptions& service) {
  LinkOptions& link = service.link;
  if (link.kind == LinkKind::rings) {
    if (link.wait_nodes != 0) throw Error("--wait-nodes: found with --link rings; expected with --link dds");
    return;
  }
  if (link.wait_nodes != 0) service.nodes = link.wait_nodes;
  if (service.nodes == 0) throw Error("--nodes: found 0; expected at least 1 with --link dds");
  if (!service.faults.empty())
    throw Error("--fail: found with --link dds; expected with --link rings (with dds, end the node processes)");
  for (const Resize& resize : service.resizes) {
    if (resize.nodes > service.nodes) {
      throw Error(
          fmt::format("--resize: found {} nodes with --link dds; expected at most {}, the number of processes; more "
                      "join on their own (ringfence node)",
                      resize.nodes, service.nodes));
    }
  }
}

/// Queries start within the bounds of the scene.
QueryLoad ray_load(const worlds::Scene& scene, std::uint32_t rays, std::uint64_t seed) {
  QueryLoad load;
  load.rays = rays;
  load.seed = seed;
  load.bounds_min = scene.bounds_min;
  load.bounds_max = scene.bounds_max;
  return load;
}

}  // namespace

WorldConfig world_config(const Job& job) {
  WorldConfig config;
  config.nodes = job.service.nodes;
  config.user_threads = job.service.user_threads;
  config.deployment = job.service.deployment;
  config.placement = job.service.placement;
  config.interest = job.service.interest;
  config.tuning.ring_bytes = job.service.ring_bytes;
  config.balance = job.service.balance;
  config.balance_by = job.service.balance_by;
  config.deadlines = job.service.deadlines;
  config.tuning.keep_resting = job.service.keep_resting;
  config.pin = job.service.pin;
  config.history = job.service.history;
  config.deepest_contacts = job.service.deepest_contacts;
  config.timeline = !job.output.trace.empty();
  config.motion = job.model;
  config.log = [](LogLevel level, std::string_view line) {
    if (level >= LogLevel::warning) fmt::print(stderr, "ringfence: {}\n", line);
  };
  worlds::configure_for(config, job.scene, job.service.users);
  return config;
}

void advance(World& world, std::uint64_t frame) {
  const Status status = world.advance();
  if (status != Status::ok) {
    throw IncompleteError(fmt::format("frame {} was refused: {}; earlier frames are complete", frame, name_of(status)));
  }
}

Job make_job(const RunOptions& options) {
  worlds::PaperWorld world = worlds::make_paper_world(options.world);
  Job job;
  job.title =
      fmt::format("{} objects ({}), seed {}", options.world.objects, name_of(options.world.shapes), options.world.seed);
  job.scene = std::move(world.scene);
  job.model = std::make_shared<motion::Steering>(world.steering);
  job.frames = options.frames;
  job.service = options.service;
  resolve_link(job.service);
  if (job.service.link.kind == LinkKind::dds) job.motion_setup = pack_motion(world.steering);
  check_resizes(job.service.resizes, job.frames.frames);
  check_faults(job.service.faults, job.frames.frames, job.service.nodes, job.service.deadlines);
  job.output = options.output;
  job.journal = options.journal;
  job.queries = ray_load(job.scene, options.rays, options.world.seed);
  job.record_prefix = options.record_prefix;
  job.world = &options.world;
  return job;
}

Job make_job(const ReplayOptions& options) {
  Job job;
  job.scene = worlds::read_scene(options.scene, read_mesh);
  const worlds::Motion motion = worlds::read_motion(options.motion, job.scene);
  job.title = fmt::format("{} objects of {}, {} frames of {}", job.scene.objects.size(), options.scene, motion.frames,
                          options.motion);
  job.model = std::make_shared<worlds::ReplayModel>(motion);
  job.service = options.service;
  resolve_link(job.service);
  if (job.service.link.kind == LinkKind::dds) job.motion_setup = pack_motion(motion);
  job.output = options.output;
  job.journal = options.journal;
  job.view = options.view;
  const std::filesystem::path scene = std::filesystem::absolute(options.scene);
  job.view.world = (scene.parent_path().filename() / scene.stem()).string();
  job.frames = options.frames;

  const std::uint32_t needed = worlds::users_of(job.scene);
  if (job.service.users_given && job.service.users < needed) {
    throw Error(
        fmt::format("--users: found {}; expected at least {}, which {} has", job.service.users, needed, options.scene));
  }
  job.service.users = std::max(job.service.users, needed);
  if (job.frames.warmup >= motion.frames) {
    throw Error(fmt::format("--warmup: found {}; expected less than the {} frames of {}", job.frames.warmup,
                            motion.frames, options.motion));
  }
  const std::uint32_t left = motion.frames - job.frames.warmup;
  if (job.frames.frames > left) {
    throw Error(fmt::format("--frames: found {}; expected at most the {} frames of {} after the warm-up",
                            job.frames.frames, left, options.motion));
  }
  if (job.frames.frames == 0) job.frames.frames = left;
  job.queries = ray_load(job.scene, options.rays, options.seed);
  if (!options.queries.empty()) {
    job.queries.rows = worlds::read_queries(options.queries, job.scene, job.frames.frames, job.service.history);
    job.queries.answers = options.answers;
    if (options.answers == "-" && job.output.collisions == "-") {
      throw Error("--answers: found - together with --collisions -; expected a file for one of them");
    }
  }
  check_resizes(job.service.resizes, job.frames.frames);
  check_faults(job.service.faults, job.frames.frames, job.service.nodes, job.service.deadlines);
  return job;
}

int run_job(Job job) {
  job.objects = job.scene.objects.size();
  const StopSignals stop;
  FrameOutputs outputs(job.output);
  FrameQueries queries(job.queries);
  std::optional<OutputFile> json;
  if (!job.output.json.empty()) json.emplace(job.output.json);
  std::optional<PictureFile> picture;
  if (!job.output.picture.empty()) picture.emplace(job.output.picture, job.output.picture_colors);
  WorldConfig config = world_config(job);
  std::optional<NodeProcesses> node_processes;
  if (job.service.link.kind == LinkKind::dds) {
    node_processes.emplace(job.service.link, config.nodes, job.motion_setup, config.log);
    config.remote_nodes = node_processes->remote_nodes();
  }
  Figures figures;
  JournalRun journal(job, figures);
  World world = journal.make_world(std::move(config));

  FrameChecker checker(world, job.output.check);
  const std::uint64_t resumed = world.frames(), total = std::uint64_t{job.frames.warmup} + job.frames.frames;
  Progress progress(job.output.quiet, total - std::min(total, resumed));
  StatusLine status(job, world, node_processes ? &*node_processes : nullptr, progress);
  std::optional<JobView> view;
  if (!job.view.address.empty()) view.emplace(world, job, figures, stop);
  while (world.frames() < job.frames.warmup && !stop.received()) {
    advance(world, world.frames());
    checker.skip_frame();
    status.step();
  }
  Recording recording(job.record_prefix, job.scene, world);
  std::exchange(job.scene.objects, {});
  figures.placement = world.config().placement;
  ResizeSchedule resize_schedule(job.service.resizes, std::max(1u, job.service.nodes));
  while (world.frames() < total && !stop.received()) {
    const auto frame = static_cast<std::uint32_t>(world.frames() - job.frames.warmup);
    resize_schedule.before_frame(frame, world);
    inject_faults(job.service.faults, frame, std::uint64_t{job.frames.warmup} + frame, world);
    if (view) view->before_frame();
    advance(world, std::uint64_t{job.frames.warmup} + frame);
    figures.add(world.report(), world.contacts());
    if (view) view->after_frame();
    resize_schedule.add_frame(world.report());
    outputs.add_frame(frame, world);
    recording.add_frame(world);
    checker.check_frame(frame);
    queries.add_frame(frame, world);
    checker.check_answers(frame, queries.rows(), queries.answers());
    status.step();
    if (frame == 0) keep_freed_arrays();  // the lists of the World have most of their size
  }
  if (view) view->hold();
  if (world.frames() < total) figures.ended_by = stop.received();
  journal.finish();
  status.finish(figures.ended_by);
  if (node_processes) figures.cluster = node_processes->report();
  recording.finish();
  outputs.finish();
  queries.finish();
  figures.queries = queries.figures();
  if (picture) {
    const std::string& contact = job.scene.contact_label;
    picture->write(world, contact.empty() ? "contact point" : contact);
  }
  if (json) {
    write_json_report(*json, job, figures, resize_schedule, checker);
    json->close();
  }
  // If contacts or answers go to standard output, the report goes to standard error.
  std::FILE* const out = job.output.collisions == "-" || job.queries.answers == "-" ? stderr : stdout;
  if (job.profile) {
    print_profile(out, job, figures);
  } else {
    print_report(out, job, figures, resize_schedule, checker);
  }
  if (!checker.passed()) return check_failed;
  return figures.ended_by == nullptr ? done : incomplete;
}

}  // namespace ringfence::tools
