#include "options.hpp"

#include <algorithm>
#include <iostream>
#include <memory>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "machine.hpp"
#include "option_checks.hpp"
#include "option_groups.hpp"
#include "option_texts.hpp"
#include "resumed_command.hpp"
#include "robots/robots_options.hpp"
#include "run_options.hpp"
#include "scale_options.hpp"
#include "serve/serve_options.hpp"
#include "usage_message.hpp"

namespace ringfence::tools {
namespace {

std::string list_exit_codes() {
  std::string text = "Exit codes:";
  for (const ExitCodeText& each : exit_codes) text += fmt::format("\n  {}  {}", static_cast<int>(each.code), each.text);
  return text;
}

void add_recorded_world(CLI::App& command, ReplayOptions& replay, bool required) {
  command.option_defaults()->group(option_groups::world);
  CLI::Option* const scene = command.add_option("--scene", replay.scene, "scene file of a recorded world, JSON");
  CLI::Option* const motion = command.add_option("--motion", replay.motion, "motion file of it, CSV or binary");
  scene->type_name("FILE")->required(required);
  motion->type_name("FILE")->required(required);
  if (required) return;
  scene->needs(motion);
  motion->needs(scene);
}

}  // namespace

CommandLineParser::CommandLineParser() : app_("Ringfence: a collision service for multiplayer worlds", "ringfence") {
  app_.set_version_flag("--version", std::string("ringfence ") + RINGFENCE_VERSION, "print the version and exit");
  app_.set_help_flag("-h,--help", "print this help and exit");
  app_.require_subcommand(1);
  app_.formatter(std::make_shared<HelpFormatter>());
  app_.footer(list_exit_codes());
  command_line_.serve.service.nodes = command_line_.run.service.nodes = command_line_.replay.service.nodes =
      command_line_.profile.run.service.nodes = std::clamp(usable_cores() - 1, 1u, 1024u);
  add_run();
  add_replay();
  add_record();
  add_scale();
  add_profile(command_line_.profile);
  add_node(*app_.add_subcommand("node", "run a CD node for a world in another process, over Cyclone DDS"),
           command_line_.node);
  add_convert(command_line_.convert);
  add_resume(command_line_.resume);
  add_journal(command_line_.journal);
  command_line_.serve.service.deadlines.node_ms = 2000;
  add_serve(*app_.add_subcommand("serve", "run a world in real time for clients over the network, with a page"),
            command_line_.serve);
  add_token(command_line_.token);
  add_robots(
      *app_.add_subcommand("robots", "connect clients to a served world, which walk and check what they receive"),
      command_line_.robots);
  for (CLI::App* const command : app_.get_subcommands([](const CLI::App*) { return true; })) {
    command->option_defaults()->group(option_groups::help);
    command->set_help_flag(app_.get_help_ptr()->get_name(false, true), app_.get_help_ptr()->get_description());
  }
}

void CommandLineParser::add_run() {
  CLI::App& run = *app_.add_subcommand("run", "generate the paper's world and run it");
  add_frames(run, command_line_.run.frames, false);
  add_world(run, command_line_.run.world);
  add_rays(run, command_line_.run);
  add_service(run, command_line_.run.service);
  add_journal_options(run, command_line_.run.journal, true);
  add_output(run, command_line_.run.output);
  run.option_defaults()->group(option_groups::faults);
  run.add_option("--soak", command_line_.run.soak_minutes,
                 "instead of --frames: make random requests and faults for this time, and check every frame")
      ->check(between(0.001, 100'000.0))
      ->type_name("MINUTES")
      ->excludes("--json", "--frames-csv", "--trace", "--collisions", "--resize", "--fail", "--status", "--metrics",
                 "--picture", "--link", "--rays");
}

void CommandLineParser::add_replay() {
  CLI::App& replay = *app_.add_subcommand("replay", "run a recorded world");
  add_recorded_world(replay, command_line_.replay, true);
  add_frames(replay, command_line_.replay.frames, true);
  add_service(replay, command_line_.replay.service);
  add_journal_options(replay, command_line_.replay.journal, true);
  add_output(replay, command_line_.replay.output);
  add_queries(replay, command_line_.replay);
  add_view(replay, command_line_.replay.view);
}

void CommandLineParser::add_record() {
  CLI::App& record =
      *app_.add_subcommand("record", "run the paper's world and record it as PREFIX.json and PREFIX.bin");
  add_frames(record, command_line_.run.frames, false);
  add_world(record, command_line_.run.world);
  add_rays(record, command_line_.run);
  add_service(record, command_line_.run.service);
  record.option_defaults()->group(option_groups::output);
  record
      .add_option("--out", command_line_.run.record_prefix,
                  "path prefix of the recording, whose replay has the same digest")
      ->required()
      ->type_name("PREFIX");
  add_output(record, command_line_.run.output);
}

void CommandLineParser::add_scale() {
  CLI::App& scale = *app_.add_subcommand(
      "scale", "run all combinations of node counts, object counts and deployments, and report how they scale");
  ScaleOptions& options = command_line_.scale;
  options.base.frames = {100, 100};
  add_frames(scale, options.base.frames, false);
  add_scale_world(scale, options);
  add_population(scale, options.base.world);
  add_scale_service(scale, options);
  add_users(scale, options.base.service);
  add_scale_output(scale, options);
  add_quiet(scale, options.base.output);
}

void CommandLineParser::add_profile(ProfileOptions& options) {
  CLI::App& profile = *app_.add_subcommand(
      "profile", "run the paper's world or a recorded one, and report the cost of the narrow phase");
  add_recorded_world(profile, options.replay, false);
  add_frames(profile, options.run.frames, true);
  add_world(profile, options.run.world);
  add_rays(profile, options.run);
  add_service(profile, options.run.service);
  add_output(profile, options.run.output);
}

void CommandLineParser::add_convert(ConvertOptions& options) {
  CLI::App& convert =
      *app_.add_subcommand("convert", "convert a recorded trace into PREFIX.json and PREFIX.csv for replay");
  convert.option_defaults()->group(option_groups::world);
  add_word(convert, "KIND", options.kind, {"air", "crowd"}, "flights as JSON, or people as text")->required();
  convert.add_option("INPUT", options.input, "the trace, uncompressed; -: standard input")
      ->required()
      ->type_name("FILE");
  convert.add_option("--copies", options.copies, "copies side by side, each a few frames later than the one before")
      ->check(between(1u, 10'000u))
      ->capture_default_str()
      ->type_name("N");
  convert.add_option("--from", options.from, "air: start at this time of day, UTC")->type_name("HH:MM");
  convert.add_option("--minutes", options.minutes, "air: minutes to convert; 0: to the end of the trace")
      ->check(between(0u, 100'000u))
      ->capture_default_str()
      ->type_name("N");
  convert.option_defaults()->group(option_groups::output);
  convert.add_option("--out", options.prefix, "path prefix of the output files")->required()->type_name("PREFIX");
}

void CommandLineParser::add_resume(ResumeOptions& options) {
  CLI::App& resume = *app_.add_subcommand("resume", "continue a run from its journal, after a stop or a crash");
  resume.option_defaults()->group(option_groups::journal);
  resume.add_option("DIR", options.directory, "the directory of --journal")->required()->type_name("DIR");
  resume.add_flag("--accept-release", options.accept_release,
                  "continue a journal that another release wrote; the contacts may differ in their last bits");
  options.run.service.nodes = command_line_.run.service.nodes;
  add_journal_options(resume, options.run.journal, false);
  add_frames(resume, options.run.frames, true);
  add_service(resume, options.run.service);
  add_clients(resume, options.serve);
  add_output(resume, options.run.output);
}

void CommandLineParser::add_journal(JournalListOptions& options) {
  CLI::App& journal = *app_.add_subcommand("journal", "list what a journal has, check it, or show one of its frames");
  journal.option_defaults()->group(option_groups::journal);
  journal.add_option("DIR", options.directory, "the directory of --journal")->required()->type_name("DIR");
  CLI::Option* const verify =
      journal.add_flag("--verify", options.verify, "run the frames from each snapshot to the next, and compare");
  const auto read = [&options](std::uint32_t frame) {
    options.frame = frame;
    options.has_frame = true;
  };
  CLI::Option* const frame =
      journal.add_option_function<std::uint32_t>("--frame", read, "a counted frame whose contacts are written");
  CLI::Option* const collisions =
      journal.add_option("--collisions", options.collisions, "where they are written, CSV; -: standard output");
  frame->check(between(0u, max_frames))->type_name("N")->needs(collisions)->excludes(verify);
  collisions->type_name("FILE")->needs(frame);
}

void CommandLineParser::add_token(TokenOptions& options) {
  CLI::App& token = *app_.add_subcommand("token", "print a token with which a client may connect to a served world");
  token.option_defaults()->group(option_groups::clients);
  token.add_option("--key", options.key, "the key of serve --token-key")->required()->type_name("FILE");
  const auto read = [&options](std::uint32_t user) {
    options.user = user;
    options.has_user = true;
  };
  token.add_option_function<std::uint32_t>("--user", read, "number of the player; required with --role play")
      ->check(between(0u, 65'535u))
      ->type_name("N");
  add_word(token, "--role", options.role, {"play", "watch", "operate"}, "what the client may do")
      ->default_str(options.role);
  token.add_option("--world", options.world, "name of the world")->capture_default_str()->type_name("NAME");
  token.add_option("--expires", options.expires_s, "seconds from now until the token expires")
      ->check(between(1u, 1'000'000'000u))
      ->capture_default_str()
      ->type_name("S");
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
  replay.rays = run.rays;
  replay.seed = run.world.seed;
  replay.frames = {command.count("--frames") > 0 ? run.frames.frames : 0,
                   command.count("--warmup") > 0 ? run.frames.warmup : 0};
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
                          : name == "resume"  ? Command::resume
                          : name == "journal" ? Command::journal
                          : name == "serve"   ? Command::serve
                          : name == "token"   ? Command::token
                          : name == "robots"  ? Command::robots
                                              : Command::convert;
  if (command_line_.command == Command::replay) command_line_.replay.service.users_given = command.count("--users") > 0;
  const std::vector<std::string> given(argv + std::min(argc, 2), argv + argc);
  command_line_.run.journal.description = describe_run(name, given);
  command_line_.replay.journal.description = command_line_.run.journal.description;
  command_line_.serve.journal.description = command_line_.run.journal.description;
  command_line_.resume.replaced = options_of_run(given, command_line_.resume.directory);
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
  fmt::print(stderr, "ringfence: {}\nringfence{} --help lists the options\n", usage_message(app_, error), command);
  return usage_error;
}

}  // namespace ringfence::tools
