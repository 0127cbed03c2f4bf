#include "run_options.hpp"

#include <charconv>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "option_checks.hpp"
#include "option_groups.hpp"
#include "picture/picture_file.hpp"

namespace ringfence::tools {
namespace {

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

void add_faults(CLI::App& command, ServiceOptions& service) {
  command.option_defaults()->group(option_groups::faults);
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
  command.add_option("--user-deadline-ms", service.deadlines.user_ms, "time a user node has to move; 0: unlimited")
      ->check(between(0.0, 1e6))
      ->capture_default_str()
      ->type_name("MS");
}

std::string check_picture(std::string& path) {
  return PictureFile::is_supported(path) ? std::string()
                                         : fmt::format("found {}; expected a name that ends in .svg or .png", path);
}

}  // namespace

void add_frames(CLI::App& command, FrameOptions& frames, bool replay) {
  command.option_defaults()->group(option_groups::world);
  CLI::Option* const count =
      command.add_option("--frames", frames.frames, replay ? "counted frames; 0: all" : "counted frames");
  count->check(between(replay ? 0u : 1u, max_frames))->capture_default_str()->type_name("N");
  command.add_option("--warmup", frames.warmup, "frames before the counted ones, not part of any output")
      ->check(between(0u, max_frames))
      ->capture_default_str()
      ->type_name("N");
}

void add_service(CLI::App& command, ServiceOptions& service) {
  command.option_defaults()->group(option_groups::service);
  add_choice(command, "--deployment", service.deployment,
             {Deployment::user, Deployment::user_server, Deployment::user_collision},
             "which nodes host objects other than avatars");
  command.add_option("--nodes", service.nodes, "number of CD nodes; 0: everything runs in one thread")
      ->check(between(0u, 1024u))
      ->default_str("usable cores less 1, at least 1")
      ->type_name("N");
  add_choice(command, "--broad-phase", service.placement, {Placement::server, Placement::region, Placement::automatic},
             "where the broad phase runs");
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
  add_users(command, service);
  add_link(command, service.link);
  add_faults(command, service);
}

void add_users(CLI::App& command, ServiceOptions& service) {
  command.option_defaults()->group(option_groups::world);
  command.add_option("--users", service.users, "number of user nodes")
      ->check(between(1u, 65'536u))
      ->capture_default_str()
      ->type_name("N");
  command.option_defaults()->group(option_groups::service);
  add_switch(command, "--balance", service.balance, "adapt the regions to the load");
  add_choice(command, "--balance-by", service.balance_by, {BalanceBy::cpu_time, BalanceBy::pairs},
             "measure of the load: CPU time, or tested pairs, which give the same region maps in every run");
  add_switch(command, "--keep-resting", service.keep_resting, "keep resting objects separate in the broad phase");
  command.add_option("--user-threads", service.user_threads, "threads that run the user nodes")
      ->check(between(1u, 256u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--interest", service.interest, "radius of the area that a user node reads, metres")
      ->check(between(0.0, 1e9))
      ->capture_default_str()
      ->type_name("R");
  command.add_option("--history", service.history, "frames before each that queries can ask about")
      ->check(between(0u, 4096u))
      ->capture_default_str()
      ->type_name("N");
  add_deepest_contacts(command, service);
  command.add_option("--ring-bytes", service.ring_bytes, "bytes of each ring, a power of two; 0: depends on the role")
      ->check(CLI::Validator(check_ring_bytes, ""))
      ->capture_default_str()
      ->type_name("N");
  command.add_flag("--pin", service.pin, "pin threads to cores");
}

void add_deepest_contacts(CLI::App& command, ServiceOptions& service) {
  command
      .add_option("--deepest-contacts", service.deepest_contacts,
                  "list a contact only if it is among the N deepest of either object; 0: list all")
      ->check(between(0u, std::numeric_limits<std::uint32_t>::max()))
      ->capture_default_str()
      ->type_name("N");
}

void add_world(CLI::App& command, worlds::PaperWorldOptions& world) {
  command.option_defaults()->group(option_groups::world);
  command.add_option("--objects", world.objects, "number of objects, avatars included")
      ->check(between(1u, 10'000'000u))
      ->capture_default_str()
      ->type_name("N");
  add_population(command, world);
}

void add_population(CLI::App& command, worlds::PaperWorldOptions& world) {
  command.option_defaults()->group(option_groups::world);
  using worlds::ShapeSetting;
  command.add_option("--coverage", world.coverage, "share of the world's volume that objects fill")
      ->check(between(1e-6, 0.6))
      ->capture_default_str()
      ->type_name("F");
  add_choice(command, "--shapes", world.shapes,
             {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull, ShapeSetting::mixed,
              ShapeSetting::mesh},
             "shapes of the objects");
  command.add_option("--seed", world.seed, "seed of all random numbers")
      ->check(between(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()).description(""))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--targets", world.targets, "number of targets that objects steer to; 0: objects / 50")
      ->check(between(0u, 10'000'000u))
      ->capture_default_str()
      ->type_name("N");
  add_interval(command, "--target-interval", world.target_interval, "frames after which a target moves elsewhere");
  add_interval(command, "--retarget-interval", world.retarget_interval,
               "frames after which an object selects another target");
}

void add_rays(CLI::App& command, RunOptions& options) {
  command.option_defaults()->group(option_groups::world);
  command.add_option("--rays", options.rays, "random rays of 50 m in each counted frame, each with its first hit")
      ->check(between(0u, 10'000'000u))
      ->capture_default_str()
      ->type_name("N");
}

void add_queries(CLI::App& command, ReplayOptions& options) {
  command.option_defaults()->group(option_groups::world);
  CLI::Option* const queries =
      command.add_option("--queries", options.queries, "rays, sweeps, overlaps and nearest points about frames, CSV");
  command.option_defaults()->group(option_groups::output);
  CLI::Option* const answers =
      command.add_option("--answers", options.answers, "write the answers to --queries as CSV; -: standard output");
  queries->type_name("FILE")->needs(answers);
  answers->type_name("FILE")->needs(queries);
}

void add_view(CLI::App& command, ViewOptions& view) {
  command.option_defaults()->group(option_groups::output);
  CLI::Option* const address =
      command.add_option("--view", view.address, "show the run in a browser, at this loopback address, in real time");
  address->type_name("HOST:PORT");
  command.add_option("--tick", view.tick, "frames per second, with --view")
      ->check(between(0.1, 1000.0))
      ->needs(address)
      ->capture_default_str()
      ->type_name("HZ");
  command.add_option("--page", view.page, "directory of the page; default: the one installed with the program")
      ->needs(address)
      ->type_name("DIR");
}

void add_journal_options(CLI::App& command, JournalOptions& journal, bool writes) {
  command.option_defaults()->group(option_groups::journal);
  if (writes) {
    command
        .add_option("--journal", journal.directory,
                    "write snapshots and the inputs of every frame to this directory; resume continues from there")
        ->type_name("DIR");
  }
  command.add_option("--snapshot-every", journal.snapshot_every, "frames between two snapshots")
      ->check(between(1u, max_frames))
      ->capture_default_str()
      ->type_name("N");
  command
      .add_option("--keep-snapshots", journal.keep_snapshots, "number of snapshots that are kept, with their frames")
      ->check(between(1u, 1'000'000u))
      ->capture_default_str()
      ->type_name("N");
  add_choice(command, "--sync", journal.sync, {JournalSync::always, JournalSync::snapshot, JournalSync::never},
             "when a frame is on the disk: at its end, with the next snapshot, or when the system decides");
}

void add_output(CLI::App& command, OutputOptions& output) {
  command.option_defaults()->group(option_groups::output);
  command.add_flag("--check", output.check, "compare every frame with brute force in double precision");
  command.add_option("--collisions", output.collisions, "write all contacts as CSV; -: standard output")
      ->type_name("FILE");
  command.add_option("--json", output.json, "write all results of the run as JSON")->type_name("FILE");
  command.add_option("--frames-csv", output.frames_csv, "write one row per frame as CSV")->type_name("FILE");
  command.add_option("--status", output.status, "write the state of the run as JSON once per second")
      ->type_name("FILE");
  command.add_option("--metrics", output.metrics, "serve metrics for Prometheus at /metrics of this loopback address")
      ->type_name("HOST:PORT");
  command.add_option("--trace", output.trace, "write a timeline in Chrome trace format, for Perfetto")
      ->type_name("FILE");
  command.add_option("--picture", output.picture, "draw the last frame from above; the name ends in .svg or .png")
      ->check(CLI::Validator(check_picture, ""))
      ->type_name("FILE");
  add_choice(command, "--picture-colors", output.picture_colors,
             {PictureColors::automatic, PictureColors::light, PictureColors::dark},
             "colours of the picture; auto: those that the reader prefers, in PNG light");
  add_quiet(command, output);
}

void add_quiet(CLI::App& command, OutputOptions& output) {
  command.option_defaults()->group(option_groups::output);
  command.add_flag("--quiet", output.quiet, "show no progress line");
}

}  // namespace ringfence::tools
