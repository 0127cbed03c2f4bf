#include "options.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iostream>
#include <map>
#include <string_view>
#include <thread>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "option_checks.hpp"
#include "picture/picture_file.hpp"
#include "scale_options.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t max_frames = 10'000'000;

void add_interval(CLI::App& command, const char* option, motion::Interval& value, const char* help) {
  const auto read = [&value, option](const std::string& text) {
    const char* const end = text.data() + text.size();
    const auto [colon, error] = std::from_chars(text.data(), end, value.min);
    bool right = error == std::errc() && colon != end && *colon == ':';
    if (right) {
      const auto [stop, second_error] = std::from_chars(colon + 1, end, value.max);
      right = second_error == std::errc() && stop == end && value.min >= 1 && value.max >= value.min &&
              value.max <= 1'000'000'000;
    }
    if (!right) {
      throw CLI::ValidationError(option,
                                 fmt::format("found {}; expected A:B frames with 1 <= A <= B <= 1000000000", text));
    }
  };
  command.add_option_function<std::string>(option, read, help)
      ->default_str(fmt::format("{}:{}", value.min, value.max))
      ->type_name("A:B");
}

/// Validates --ring-bytes: 0, which selects a size by role, or a power of two.
std::string check_ring_bytes(std::string& text) {
  std::uint64_t value = 0;
  const bool number = CLI::detail::lexical_cast(text, value);
  const bool right = number && (value == 0 || (value >= 4096 && value <= 1u << 30 && (value & (value - 1)) == 0));
  return right ? std::string() : fmt::format("found {}; expected 0 or a power of two from 4096 to 1073741824", text);
}

std::string check_picture(std::string& path) {
  return PictureFile::is_supported(path) ? std::string()
                                         : fmt::format("found {}; expected a name that ends in .svg or .png", path);
}

}  // namespace

CommandLineParser::CommandLineParser() : app_("Ringfence: a collision service for multiplayer worlds", "ringfence") {
  app_.set_version_flag("--version", std::string("ringfence ") + RINGFENCE_VERSION);
  app_.require_subcommand(1);
  app_.get_formatter()->column_width(36);
  const std::uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  command_line_.run.service.nodes = command_line_.replay.service.nodes = command_line_.profile.run.service.nodes =
      std::clamp(cores - 1, 1u, 1024u);

  CLI::App& run = *app_.add_subcommand("run", "generate the paper's world and run it");
  add_frames(run, command_line_.run.frames, false);
  add_service(run, command_line_.run.service);
  add_world(run, command_line_.run.world);
  add_output(run, command_line_.run.output);
  run.add_option("--soak", command_line_.run.soak_minutes,
                 "instead of --frames: make random requests and faults for this time, and check every frame")
      ->check(between(0.001, 100'000.0))
      ->type_name("MINUTES")
      ->excludes("--json", "--frames-csv", "--trace", "--collisions", "--resize", "--fail", "--status", "--picture",
                 "--link");

  CLI::App& replay = *app_.add_subcommand("replay", "run a recorded world");
  replay.add_option("--scene", command_line_.replay.scene, "scene file, JSON")->required()->type_name("FILE");
  replay.add_option("--motion", command_line_.replay.motion, "motion file, CSV or binary")
      ->required()
      ->type_name("FILE");
  add_frames(replay, command_line_.replay.frames, true);
  add_service(replay, command_line_.replay.service);
  add_output(replay, command_line_.replay.output);

  CLI::App& record =
      *app_.add_subcommand("record", "run the paper's world and record it as PREFIX.json and PREFIX.bin");
  record
      .add_option("--out", command_line_.run.record_prefix,
                  "path prefix of the recording, whose replay has the same digest")
      ->required()
      ->type_name("PREFIX");
  add_frames(record, command_line_.run.frames, false);
  add_service(record, command_line_.run.service);
  add_world(record, command_line_.run.world);
  add_output(record, command_line_.run.output);

  CLI::App& scale = *app_.add_subcommand(
      "scale", "run all combinations of node counts, object counts and deployments, and report how they scale");
  command_line_.scale.base.frames = {100, 100};
  add_scale_options(scale, command_line_.scale);
  add_frames(scale, command_line_.scale.base.frames, false);
  add_users(scale, command_line_.scale.base.service);
  add_population(scale, command_line_.scale.base.world);
  scale.add_flag("--quiet", command_line_.scale.base.output.quiet, "show no progress line");

  add_profile(command_line_.profile);

  add_node(*app_.add_subcommand("node", "run a CD node for a world in another process, over Cyclone DDS"),
           command_line_.node);

  CLI::App& convert =
      *app_.add_subcommand("convert", "convert a recorded trace into PREFIX.json and PREFIX.csv for replay");
  ConvertOptions& options = command_line_.convert;
  convert.add_option("KIND", options.kind, "air: flights as JSON; crowd: people as text")
      ->required()
      ->check(CLI::IsMember({"air", "crowd"}));
  convert.add_option("INPUT", options.input, "the trace, uncompressed; -: standard input")->required();
  convert.add_option("--out", options.prefix, "path prefix of the output files")->required()->type_name("PREFIX");
  convert.add_option("--copies", options.copies, "copies side by side, each a few frames later than the one before")
      ->check(between(1u, 10'000u))
      ->capture_default_str()
      ->type_name("N");
  convert.add_option("--from", options.from, "air: start at this time of day, UTC")->type_name("HH:MM");
  convert.add_option("--minutes", options.minutes, "air: minutes to convert; 0: to the end of the trace")
      ->check(between(0u, 100'000u))
      ->capture_default_str()
      ->type_name("N");
}

void CommandLineParser::add_profile(ProfileOptions& options) {
  CLI::App& profile = *app_.add_subcommand(
      "profile", "run the paper's world or a recorded one, and report the cost of the narrow phase");
  CLI::Option* const scene =
      profile.add_option("--scene", options.replay.scene, "scene file of a recorded world, JSON");
  CLI::Option* const motion = profile.add_option("--motion", options.replay.motion, "motion file, CSV or binary");
  scene->needs(motion)->type_name("FILE");
  motion->needs(scene)->type_name("FILE");
  add_frames(profile, options.run.frames, true);
  add_service(profile, options.run.service);
  add_world(profile, options.run.world);
  add_output(profile, options.run.output);
}

// Options that run and replay share are parsed into those of the run; copies them to those of the replay.
void CommandLineParser::resolve_profile(const CLI::App& command) {
  RunOptions& run = command_line_.profile.run;
  ReplayOptions& replay = command_line_.profile.replay;
  run.world.users = run.service.users;
  if (replay.scene.empty()) {
    if (run.frames.frames == 0) {
      throw CLI::ValidationError("--frames", fmt::format("found 0; expected 1 to {}", max_frames));
    }
    return;
  }
  replay.service = run.service;
  replay.service.users_given = command.count("--users") > 0;
  replay.output = run.output;
  replay.frames = {command.count("--frames") > 0 ? run.frames.frames : 0,
                   command.count("--warmup") > 0 ? run.frames.warmup : 0};
}

void CommandLineParser::add_frames(CLI::App& command, FrameOptions& frames, bool replay) {
  CLI::Option* const count =
      command.add_option("--frames", frames.frames, replay ? "counted frames; 0: all" : "counted frames");
  count->check(between(replay ? 0u : 1u, max_frames))->capture_default_str()->type_name("N");
  command.add_option("--warmup", frames.warmup, "frames before the counted ones, not part of any output")
      ->check(between(0u, max_frames))
      ->capture_default_str()
      ->type_name("N");
}

void CommandLineParser::add_service(CLI::App& command, ServiceOptions& service) {
  add_choice(command, "--deployment", service.deployment,
             {Deployment::user, Deployment::user_server, Deployment::user_collision},
             "which nodes host objects other than avatars");
  command.add_option("--nodes", service.nodes, "number of CD nodes; 0: everything runs in one thread")
      ->check(between(0u, 1024u))
      ->capture_default_str()
      ->type_name("N");
  const auto read_resize = [&service](const std::string& text) {
    try {
      const std::vector<Resize> resizes = parse_resizes(text);
      service.resizes.insert(service.resizes.end(), resizes.begin(), resizes.end());
    } catch (const Error& error) {
      throw CLI::ValidationError("--resize", error.what());
    }
  };
  command.add_option_function<std::string>("--resize", read_resize, "change to N CD nodes in counted frame FRAME")
      ->trigger_on_parse()
      ->take_last()
      ->type_name("FRAME:N,...");
  const auto read_fault = [&service](const std::string& text) {
    try {
      const std::vector<Fault> faults = parse_faults(text);
      service.faults.insert(service.faults.end(), faults.begin(), faults.end());
    } catch (const Error& error) {
      throw CLI::ValidationError("--fail", error.what());
    }
  };
  command
      .add_option_function<std::string>("--fail", read_fault,
                                        "CD node NODE, or user node N as uN, stops at STAGE in counted frame FRAME")
      ->trigger_on_parse()
      ->take_last()
      ->type_name("FRAME:NODE:STAGE,...");
  command
      .add_option("--node-deadline-ms", service.deadlines.node_ms,
                  "a CD node that is silent for this long is lost; 0: never")
      ->check(between(0.0, 1e6))
      ->capture_default_str()
      ->type_name("MS");
  command
      .add_option("--user-deadline-ms", service.deadlines.user_ms,
                  "time a user node has to move and to read its contacts; 0: unlimited")
      ->check(between(0.0, 1e6))
      ->capture_default_str()
      ->type_name("MS");
  add_choice(command, "--broad-phase", service.placement, {Placement::server, Placement::region, Placement::automatic},
             "where the broad phase runs");
  add_link(command, service.link);
  add_users(command, service);
}

void CommandLineParser::add_users(CLI::App& command, ServiceOptions& service) {
  add_switch(command, "--balance", service.balance, "adapt the regions to the load");
  add_choice(command, "--balance-by", service.balance_by, {BalanceBy::cpu_time, BalanceBy::pairs},
             "measure of the load: CPU time, or tested pairs, which give the same region maps in every run");
  add_switch(command, "--keep-resting", service.keep_resting, "keep resting objects separate in the broad phase");
  command.add_option("--users", service.users, "number of user nodes")
      ->check(between(1u, 65'536u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--user-threads", service.user_threads, "threads that run the user nodes")
      ->check(between(1u, 256u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--interest", service.interest, "radius of the area that a user node reads, metres")
      ->check(between(0.0, 1e9))
      ->capture_default_str()
      ->type_name("R");
  command.add_option("--ring-bytes", service.ring_bytes, "bytes of each ring, a power of two; 0: depends on the role")
      ->check(CLI::Validator(check_ring_bytes, ""))
      ->capture_default_str()
      ->type_name("N");
  command.add_flag("--pin", service.pin, "pin threads to cores");
}

void CommandLineParser::add_world(CLI::App& command, worlds::PaperWorldOptions& world) {
  command.add_option("--objects", world.objects, "number of objects, avatars included")
      ->check(between(1u, 10'000'000u))
      ->capture_default_str()
      ->type_name("N");
  add_population(command, world);
}

void CommandLineParser::add_population(CLI::App& command, worlds::PaperWorldOptions& world) {
  using worlds::ShapeSetting;
  command.add_option("--coverage", world.coverage, "share of the world's volume that objects fill")
      ->check(between(1e-6, 0.6))
      ->capture_default_str()
      ->type_name("F");
  add_choice(command, "--shapes", world.shapes,
             {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull, ShapeSetting::mixed,
              ShapeSetting::mesh},
             "shapes of the objects");
  command.add_option("--seed", world.seed, "seed of all random numbers")->capture_default_str()->type_name("N");
  command.add_option("--targets", world.targets, "number of targets that objects steer to; 0: objects / 50")
      ->check(between(0u, 10'000'000u))
      ->capture_default_str()
      ->type_name("N");
  add_interval(command, "--target-interval", world.target_interval, "frames after which a target moves elsewhere");
  add_interval(command, "--retarget-interval", world.retarget_interval,
               "frames after which an object selects another target");
}

void CommandLineParser::add_output(CLI::App& command, OutputOptions& output) {
  command.add_flag("--check", output.check, "compare every frame with brute force in double precision");
  command.add_option("--collisions", output.collisions, "write all contacts as CSV; -: standard output")
      ->type_name("FILE");
  command.add_option("--json", output.json, "write all results of the run as JSON")->type_name("FILE");
  command.add_option("--frames-csv", output.frames_csv, "write one row per frame as CSV")->type_name("FILE");
  command.add_option("--status", output.status, "write the state of the run as JSON once per second")
      ->type_name("FILE");
  command.add_option("--trace", output.trace, "write a timeline in Chrome trace format, for Perfetto")
      ->type_name("FILE");
  command.add_option("--picture", output.picture, "draw the last frame from above; the name ends in .svg or .png")
      ->check(CLI::Validator(check_picture, ""))
      ->type_name("FILE");
  add_choice(command, "--picture-colors", output.picture_colors,
             {PictureColors::automatic, PictureColors::light, PictureColors::dark},
             "colours of the picture; auto: those that the reader prefers, in PNG light");
  command.add_flag("--quiet", output.quiet, "show no progress line");
}

CommandLine CommandLineParser::parse(int argc, char** argv) {
  app_.parse(argc, argv);
  const CLI::App& command = *app_.get_subcommands().front();
  const std::string name = command.get_name();
  using Command = CommandLine::Command;
  command_line_.command = name == "run"       ? Command::run
                          : name == "replay"  ? Command::replay
                          : name == "record"  ? Command::record
                          : name == "scale"   ? Command::scale
                          : name == "profile" ? Command::profile
                          : name == "node"    ? Command::node
                                              : Command::convert;
  if (command_line_.command == Command::replay) command_line_.replay.service.users_given = command.count("--users") > 0;
  command_line_.run.world.users = command_line_.run.service.users;
  command_line_.scale.base.world.users = command_line_.scale.base.service.users;
  if (command_line_.command == Command::profile) resolve_profile(command);
  return command_line_;
}

int CommandLineParser::print_outcome(const CLI::ParseError& error) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) {
    app_.exit(error, std::cout, std::cerr);
    return done;
  }
  const auto commands = app_.get_subcommands();
  const std::string command = commands.empty() ? "" : " " + commands.front()->get_name();
  std::string what = error.what();
  for (const CLI::Option* option : commands.empty() ? std::vector<CLI::Option*>() : commands.front()->get_options()) {
    if (error.get_name() == "ArgumentMismatch" && option->count() > 1 && option->get_items_expected_max() == 1) {
      what = fmt::format("{}: given {} times; expected once", option->get_name(), option->count());
    }
  }
  fmt::print(stderr, "ringfence: {}\nringfence{} --help lists the options\n", what, command);
  return usage_error;
}

}  // namespace ringfence::tools
