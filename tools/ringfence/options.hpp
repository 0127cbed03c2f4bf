#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "faults.hpp"
#include "link_options.hpp"
#include "picture/palette.hpp"
#include "resize.hpp"
#include "ringfence/config.hpp"
#include "ringfence/journal.hpp"
#include "worlds/paper_world.hpp"
#include "worlds/plaza.hpp"

namespace ringfence::tools {

/// Frames to run. Frames after the warm-up are counted: only they appear in reports and output files.
struct FrameOptions {
  std::uint32_t frames = 0;  ///< counted frames; replay: 0 for all
  std::uint32_t warmup = 0;
};

/// Configuration of the service. Common to run, replay, record and profile.
struct ServiceOptions {
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::automatic;
  std::uint32_t nodes = 1;
  std::vector<Resize> resizes;  ///< make_job checks and sorts them
  std::vector<Fault> faults;
  Deadlines deadlines;
  bool balance = true;
  BalanceBy balance_by = BalanceBy::cpu_time;
  bool keep_resting = true;
  std::uint32_t users = 100;
  bool users_given = false;
  std::uint32_t user_threads = 1;
  double interest = 25;
  std::uint32_t history = 0;
  std::uint32_t deepest_contacts = 0;
  std::uint64_t ring_bytes = 0;
  bool pin = false;
  LinkOptions link;
};

/// The journal of a run; see JournalConfig.
struct JournalOptions {
  std::string directory;  ///< empty: no journal
  JournalSync sync = JournalSync::snapshot;
  std::uint32_t snapshot_every = 600;
  std::uint32_t keep_snapshots = 3;
  /// `resume` only: continue the journal, and accept one of another release.
  bool resumes = false;
  bool accept_release = false;
  std::string description;  ///< of a new journal: what `resume` needs to know
};

/// Output of a run. An empty path means no file.
struct OutputOptions {
  bool check = false;
  std::string collisions;
  std::string json;
  std::string frames_csv;
  std::string trace;
  std::string picture;
  PictureColors picture_colors = PictureColors::automatic;
  bool quiet = false;
  std::string metrics;  ///< HOST:PORT
  std::string status;   ///< rewritten once a second
};

struct RunOptions {
  FrameOptions frames{600, 60};
  ServiceOptions service;
  worlds::PaperWorldOptions world;
  OutputOptions output;
  JournalOptions journal;     ///< `run` only
  std::uint32_t rays = 0;     ///< random rays of each counted frame
  std::string record_prefix;  ///< `record` only
  double soak_minutes = 0;    ///< `run` only; 0: no soak
};

/// Options of `replay` for the page that shows the run.
struct ViewOptions {
  std::string address;  ///< HOST:PORT; empty: none
  std::string world;    ///< name of the world
  std::string page;     ///< directory; empty: that of the program
  double tick = 10;     ///< frames per second
};

struct ReplayOptions {
  FrameOptions frames;
  ServiceOptions service;
  OutputOptions output;
  JournalOptions journal;  ///< `replay` only
  std::string scene;
  std::string motion;
  std::string queries;     ///< `replay` only; empty: none
  std::string answers;     ///< `replay` only
  ViewOptions view;        ///< `replay` only
  std::uint32_t rays = 0;  ///< `profile` only: as RunOptions::rays
  std::uint64_t seed = 1;  ///< of the rays
};

/// Options of `ringfence scale`, which runs every combination of the lists.
struct ScaleOptions {
  std::vector<Deployment> deployments{Deployment::user, Deployment::user_server, Deployment::user_collision};
  std::vector<Placement> placements{Placement::server};
  std::vector<std::uint32_t> nodes{1, 2, 4, 8, 16};
  std::vector<std::uint32_t> objects{1000, 2000, 3000, 4000};
  std::uint32_t repeats = 3;
  std::vector<std::string> models;  ///< names of the cluster models to evaluate
  std::vector<std::string> costs;   ///< NAME=VALUE: overrides of costs of the models
  std::string json, csv, plots;     ///< output paths; empty: none
  /// Options that all runs share: frames, world, users, progress.
  RunOptions base;
};

/// Options of `ringfence profile`, which runs the paper's world, or a replay if a scene is given.
struct ProfileOptions {
  RunOptions run;
  ReplayOptions replay;
};

/// Options of `ringfence serve`.
struct ServeOptions {
  worlds::PlazaOptions plaza;
  std::string scene;         ///< empty: the square
  std::uint32_t robots = 0;  ///< avatars that the server moves
  std::uint32_t frames = 0;  ///< in all; 0: until a signal
  std::string listen = "127.0.0.1:8080";
  double tick = 20;                         ///< frames per second
  std::string certificate, key, token_key;  ///< files; empty: none
  std::string world = "ringfence";          ///< name, for tokens
  std::size_t max_clients = 10'000;
  std::vector<std::string> origins;
  double grace_s = 30;
  std::string page;     ///< directory; empty: that of the program
  std::string network;  ///< empty: as it is
  ServiceOptions service;
  JournalOptions journal;
  OutputOptions output;  ///< `json` and `quiet`
};

/// Options of `ringfence token`.
struct TokenOptions {
  std::string key;  ///< file
  std::string role = "play";
  std::string world = "ringfence";
  std::uint32_t user = 0;
  bool has_user = false;
  std::uint32_t expires_s = 3600;
};

/// Options of `ringfence resume`. The options of the run are in the journal; those that are given replace them.
struct ResumeOptions {
  std::string directory;
  bool accept_release = false;
  std::vector<std::string> replaced;  ///< what is given for the run, as on the command line
  RunOptions run;                     ///< only to check and describe them
  ServeOptions serve;                 ///< the same, for a served world
};

/// Options of `ringfence journal`.
struct JournalListOptions {
  std::string directory;
  bool verify = false;
  bool has_frame = false;
  std::uint32_t frame = 0;  ///< counted
  std::string collisions;
};

/// Options of `ringfence robots`.
struct RobotsOptions {
  std::string url;
  std::uint32_t clients = 10;
  double seconds = 10;
  std::uint64_t seed = 1;
  std::string inputs = "every";  ///< every or change
  bool predicts = false;         ///< their avatars
  std::string token_key;         ///< file; empty: guests
  std::string world = "ringfence";
  std::uint32_t first_user = 0;
  std::string from;       ///< IP address from which they connect; empty: the system chooses
  std::string authority;  ///< file of a certificate; empty: those of the system
  std::string json;       ///< path; empty: none
};

struct ConvertOptions {
  std::string kind;  ///< air or crowd
  std::string input;
  std::string prefix;
  std::uint32_t copies = 1;
  std::string from;  ///< air: start time of day, UTC hh:mm; empty: start of the trace
  std::uint32_t minutes = 0;
};

/// The parsed command line: the command and its options.
struct CommandLine {
  enum class Command : std::uint8_t {
    run,
    replay,
    record,
    convert,
    scale,
    profile,
    node,
    resume,
    journal,
    serve,
    token,
    robots
  };
  Command command = Command::run;
  RunOptions run;  ///< of `run` and of `record`
  ReplayOptions replay;
  ConvertOptions convert;
  ScaleOptions scale;
  ProfileOptions profile;
  NodeOptions node;
  ResumeOptions resume;
  JournalListOptions journal;
  ServeOptions serve;
  TokenOptions token;
  RobotsOptions robots;
};

/// Defines all options and parses the command line.
class CommandLineParser {
 public:
  CommandLineParser();
  /// Throws CLI::ParseError, also for --help and --version. For an invalid value its message has the valid range.
  CommandLine parse(int argc, char** argv);
  /// Prints what a ParseError stands for: help, version or an error message. Returns the exit code.
  int print_outcome(const CLI::ParseError& error);
  /// The commands and their options, for texts that are generated from them. Lives as long as the parser.
  const CLI::App& app() const noexcept { return app_; }

 private:
  void add_run();
  void add_replay();
  void add_record();
  void add_scale();
  void add_profile(ProfileOptions& options);
  void add_convert(ConvertOptions& options);
  void add_resume(ResumeOptions& options);
  void add_journal(JournalListOptions& options);
  void add_token(TokenOptions& options);
  void resolve_profile(const CLI::App& command);

  CLI::App app_;
  CommandLine command_line_;
};

}  // namespace ringfence::tools
