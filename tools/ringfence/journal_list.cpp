#include "journal_list.hpp"

#include <string>
#include <utility>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "frame_outputs.hpp"
#include "job.hpp"
#include "resumed_command.hpp"
#include "ringfence/journal.hpp"
#include "serve/serve.hpp"
#include "soak/soak_run.hpp"

namespace ringfence::tools {
namespace {

/// The job of the run that wrote the journal, and its world without threads and without a log.
struct Origin {
  Job job;
  WorldConfig config;
};

Origin origin_of(const JournalContents& contents) {
  const CommandLine line = parse_command(command_of(contents.description, {}));
  const bool is_soak = line.run.soak_minutes > 0;
  Job job = line.command == CommandLine::Command::replay  ? make_job(line.replay)
            : line.command == CommandLine::Command::serve ? make_job(line.serve)
                                                          : make_job(line.run);
  job.world = nullptr;  // refers to the command line
  if (is_soak) job = soak_job(std::move(job));
  WorldConfig config = is_soak ? soak_config(job) : world_config(job);
  config.nodes = 0;
  config.log = nullptr;
  return {std::move(job), std::move(config)};
}

void print_contents(const JournalContents& contents) {
  fmt::print("release     {}\n", contents.release);
  fmt::print("files       {:.2f} MB\n", static_cast<double>(contents.file_bytes) / 1e6);
  for (const JournalFrames& run : contents.frames) {
    fmt::print("frames      {} to {}: inputs {:.3f} MB, {:.3f} MB in the journal\n", run.first, run.last,
               static_cast<double>(run.inputs) / 1e6, static_cast<double>(run.bytes) / 1e6);
  }
  if (contents.frames.size() > 1) fmt::print("gaps        {}\n", contents.frames.size() - 1);
  if (!contents.irreproducible.empty()) {
    fmt::print("known only from the snapshots after them: {} frames, the last is {}\n", contents.irreproducible.size(),
               contents.irreproducible.back());
  }
  fmt::print("snapshot before frame        MB  in memory MB\n");
  for (const JournalSnapshot& snapshot : contents.snapshots) {
    fmt::print("  {:>19} {:>9.3f} {:>13.3f}\n", snapshot.frame, static_cast<double>(snapshot.bytes) / 1e6,
               static_cast<double>(snapshot.memory) / 1e6);
  }
}

int verify(const JournalReader& reader, const JournalContents& contents) {
  const auto differs = reader.verify(origin_of(contents).config);
  if (differs) {
    fmt::print("FAILED: after frame {} the world differs from the snapshot\n", *differs - 1);
    return check_failed;
  }
  fmt::print("verified: each snapshot is what the frames since the one before it lead to\n");
  return done;
}

int write_frame(const JournalReader& reader, const JournalContents& contents, const JournalListOptions& options) {
  const Origin origin = origin_of(contents);
  OutputOptions output;
  output.collisions = options.collisions;
  FrameOutputs outputs(output);
  const World world = reader.restore(origin.config, std::uint64_t{origin.job.frames.warmup} + options.frame + 1);
  outputs.add_frame(options.frame, world);
  outputs.finish();
  return done;
}

}  // namespace

int list_journal(const JournalListOptions& options) {
  const JournalReader reader(options.directory);
  const JournalContents contents = reader.contents();
  if (options.has_frame) return write_frame(reader, contents, options);
  print_contents(contents);
  return options.verify ? verify(reader, contents) : done;
}

}  // namespace ringfence::tools
