#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "faults.hpp"
#include "link_options.hpp"
#include "resize.hpp"
#include "ringfence/config.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::tools {

/// Which frames count.
struct FrameOptions {
  std::uint32_t frames = 0;  ///< replay: 0 means all
  std::uint32_t warmup = 0;
};

/// How the service is set up; the same for run, replay and record.
struct ServiceOptions {
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  std::uint32_t nodes = 1;
  std::vector<Resize> resizes;  ///< as given, until the job has checked them
  std::vector<Fault> faults;
  Deadlines deadlines;
  bool balance = true;
  BalanceBy balance_by = BalanceBy::cpu_time;
  bool keep_resting = true;
  std::uint32_t users = 100;
  bool users_given = false;
  std::uint32_t user_threads = 1;
  double interest = 25;
  std::uint64_t ring_bytes = 0;
  bool pin = false;
  LinkOptions link;
};

/// What comes out, and where; an empty path is none.
struct OutputOptions {
  bool check = false;
  std::string collisions;
  std::string json;
  std::string frames_csv;
  std::string trace;
  bool quiet = false;
  std::string status;  ///< rewritten once a second
};

struct RunOptions {
  FrameOptions frames{600, 60};
  ServiceOptions service;
  worlds::PaperWorldOptions world;
  OutputOptions output;
  std::string record_prefix;  ///< record only
  double soak_minutes = 0;    ///< run only; 0: no soak
};

struct ReplayOptions {
  FrameOptions frames;
  ServiceOptions service;
  OutputOptions output;
  std::string scene;
  std::string motion;
};

/// What `ringfence scale` runs: every combination of the lists.
struct ScaleOptions {
  std::vector<Deployment> deployments{Deployment::user, Deployment::user_server, Deployment::user_collision};
  std::vector<Placement> placements{Placement::server};
  std::vector<std::uint32_t> nodes{1, 2, 4, 8, 16};
  std::vector<std::uint32_t> objects{1000, 2000, 3000, 4000};
  std::uint32_t repeats = 3;
  std::vector<std::string> models;  ///< names of cluster models to compute from the runs
  std::vector<std::string> costs;   ///< NAME=VALUE, in place of a cost of the models
  std::string json, csv, plots;     ///< where to; empty: none
  /// What all runs share: frames, world, users, progress.
  RunOptions base;
};

/// `ringfence profile`: the paper's world, or a replay if a scene is given.
struct ProfileOptions {
  RunOptions run;
  ReplayOptions replay;
};

struct ConvertOptions {
  std::string kind;  ///< air or crowd
  std::string input;
  std::string prefix;
  std::uint32_t copies = 1;
  std::string from;  ///< air: UTC hh:mm
  std::uint32_t minutes = 0;
};

/// Everything that the command line can say, and which command it was.
struct CommandLine {
  enum class Command : std::uint8_t { run, replay, record, convert, scale, profile, node };
  Command command = Command::run;
  RunOptions run;  ///< record too
  ReplayOptions replay;
  ConvertOptions convert;
  ScaleOptions scale;
  ProfileOptions profile;
  NodeOptions node;
};

/// Reads the command line. Throws CLI::ParseError, also for --help and --version; values out of range are told with
/// the range.
class CommandLineParser {
 public:
  CommandLineParser();
  CommandLine parse(int argc, char** argv);
  /// Prints help, version or the error; answers the exit code.
  int print_outcome(const CLI::ParseError& error);

 private:
  void add_profile(ProfileOptions& options);
  void resolve_profile(const CLI::App& command);
  void add_frames(CLI::App& command, FrameOptions& frames, bool replay);
  void add_service(CLI::App& command, ServiceOptions& service);
  void add_users(CLI::App& command, ServiceOptions& service);
  void add_world(CLI::App& command, worlds::PaperWorldOptions& world);
  void add_population(CLI::App& command, worlds::PaperWorldOptions& world);
  void add_output(CLI::App& command, OutputOptions& output);

  CLI::App app_;
  CommandLine command_line_;
};

}  // namespace ringfence::tools
