// A disk that is full: the size of files is limited.
#include <csignal>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <sys/resource.h>

#include "facade/script.hpp"
#include "journal/journal_world.hpp"

namespace ringfence::test {
namespace {

/// Files of this process cannot become larger than `bytes` while it exists.
class FileLimit {
 public:
  explicit FileLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    REQUIRE(setrlimit(RLIMIT_FSIZE, &limit) == 0);
  }
  ~FileLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST_CASE("if the journal cannot be written, frames stop with `always`, and otherwise go on without it") {
  for (const JournalSync sync : {JournalSync::always, JournalSync::snapshot}) {
    CAPTURE(name_of(sync));
    const TemporaryDirectory directory;
    std::vector<std::string> log;
    JournalConfig journal;
    journal.directory = directory.path();
    journal.sync = sync;
    journal.snapshot_every = 3;
    journal.log = [&](LogLevel, std::string_view line) { log.emplace_back(line); };
    WorldConfig config = journal_world(1);
    const auto recorder = Journal::create(journal);
    config.recorder = recorder;
    World world(config);
    Script script(world, 1, journal_side);
    for (int frame = 0; frame < 4; ++frame) {
      script.make_requests();
      REQUIRE(world.advance() == Status::ok);
    }
    REQUIRE(recorder->flush());
    {
      const FileLimit limit(4096);
      Status status = Status::ok;
      for (int frame = 0; frame < 12 && status == Status::ok; ++frame) {
        script.make_requests();
        status = world.advance();
        (void)recorder->flush();
      }
      CHECK(status == (sync == JournalSync::always ? Status::journal_failed : Status::ok));
      CHECK(world.advance() == status);
    }
    CHECK(!recorder->failure().empty());
    REQUIRE(log.size() == 1);
    CHECK(log[0].find(directory.path().string()) != std::string::npos);
    // What was written before can be used.
    const JournalReader reader(directory.path());
    CHECK(reader.frames() >= 4);
    CHECK(reader.restore(journal_world(0), reader.frames()).frames() >= 4);
  }
}

}  // namespace
}  // namespace ringfence::test
