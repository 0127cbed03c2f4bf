#include <exception>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "convert.hpp"
#include "exit_code.hpp"
#include "heap_limits.hpp"
#include "job.hpp"
#include "journal_list.hpp"
#include "node_processes.hpp"
#include "options.hpp"
#include "resume.hpp"
#include "robots/robots.hpp"
#include "scale.hpp"
#include "serve/serve.hpp"
#include "serve/token_command.hpp"
#include "soak/soak_lives.hpp"
#include "soak/soak_run.hpp"

namespace ringfence::tools {
namespace {

int profile(const ProfileOptions& options) {
  return_freed_arrays();
  Job job = options.replay.scene.empty() ? make_job(options.run) : make_job(options.replay);
  job.profile = true;
  return run_job(std::move(job));
}

int soak(const RunOptions& options) {
  if (!options.journal.directory.empty()) return run_soak_lives(options);
  return run_soak(make_job(options), options.soak_minutes, options.world.seed);
}

int run(const CommandLine& line) {
  switch (line.command) {
    case CommandLine::Command::run:
      if (line.run.soak_minutes > 0) return soak(line.run);
      [[fallthrough]];
    case CommandLine::Command::record:
      return_freed_arrays();
      return run_job(make_job(line.run));
    case CommandLine::Command::replay:
      return_freed_arrays();
      return run_job(make_job(line.replay));
    case CommandLine::Command::scale:
      return scale(line.scale);
    case CommandLine::Command::profile:
      return profile(line.profile);
    case CommandLine::Command::node:
      return run_node(line.node);
    case CommandLine::Command::resume:
      return resume(line.resume);
    case CommandLine::Command::journal:
      return list_journal(line.journal);
    case CommandLine::Command::serve:
      return_freed_arrays();
      return serve(line.serve);
    case CommandLine::Command::token:
      return print_token(line.token);
    case CommandLine::Command::robots:
      return run_robots(line.robots);
    case CommandLine::Command::convert:
      break;
  }
  return convert(line.convert);
}

int run_guarded(int argc, char** argv) {
  CommandLineParser parser;
  CommandLine line;
  try {
    line = parser.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return parser.print_outcome(error);
  }
  try {
    return run(line);
  } catch (const IncompleteError& error) {
    fmt::print(stderr, "ringfence: {}\n", error.what());
    return incomplete;
  } catch (const Error& error) {
    fmt::print(stderr, "ringfence: {}\n", error.what());
    return usage_error;
  }
}

}  // namespace
}  // namespace ringfence::tools

int main(int argc, char** argv) {
  try {
    return ringfence::tools::run_guarded(argc, argv);
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "ringfence: out of memory\n");
  } catch (const std::exception& error) {
    fmt::print(stderr, "ringfence: {}\n", error.what());
  }
  return ringfence::tools::incomplete;
}
