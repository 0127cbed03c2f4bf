#include "resume.hpp"

#include <fmt/format.h>

#include "job.hpp"
#include "resumed_command.hpp"
#include "ringfence/error.hpp"
#include "serve/serve.hpp"

namespace ringfence::tools {

int resume(const ResumeOptions& options) {
  const JournalContents contents = JournalReader(options.directory).contents();
  CommandLine line = parse_command(command_of(contents.description, options.replaced));
  const auto continue_journal = [&](JournalOptions& journal) {
    journal.directory = options.directory;
    journal.resumes = true;
    journal.accept_release = options.accept_release;
    journal.description = contents.description;
  };
  if (line.command == CommandLine::Command::serve) {
    continue_journal(line.serve.journal);
    return serve(line.serve);
  }
  if (line.run.soak_minutes > 0) {
    throw Error(fmt::format("{} is the journal of a soak, which no other run continues: see ringfence journal",
                            options.directory));
  }
  const auto run = [&](auto& run_options) {
    continue_journal(run_options.journal);
    return run_job(make_job(run_options));
  };
  return line.command == CommandLine::Command::replay ? run(line.replay) : run(line.run);
}

}  // namespace ringfence::tools
