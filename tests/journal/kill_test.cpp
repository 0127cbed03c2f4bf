// Processes that are killed while they run a world with a journal.
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "facade/script.hpp"
#include "journal/journal_world.hpp"

namespace ringfence::test {
namespace {

struct Acknowledged {
  std::uint64_t frames = 0, fingerprint = 0;
};

/// Starts a process, kills it after it has acknowledged some frames, and returns the last of them. Kills at a random
/// moment of a later frame: after a random number of bytes of its output would be too regular, so it polls without
/// waiting a random number of times.
Acknowledged run_and_kill(const std::string& directory, std::uint32_t seed, std::mt19937& random) {
  int ends[2];
  REQUIRE(pipe2(ends, O_CLOEXEC) == 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  std::string program = RINGFENCE_JOURNAL_PROCESS, path = directory, number = std::to_string(seed);
  char* arguments[] = {program.data(), path.data(), number.data(), nullptr};
  pid_t process = 0;
  REQUIRE(posix_spawn(&process, program.c_str(), &actions, nullptr, arguments, environ) == 0);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  std::FILE* const lines = fdopen(ends[0], "r");
  Acknowledged last;
  unsigned long long frames = 0, fingerprint = 0;
  for (std::uint32_t wanted = 1 + static_cast<std::uint32_t>(random() % 12); wanted > 0; --wanted) {
    if (std::fscanf(lines, "%llu %llu", &frames, &fingerprint) != 2) break;
    last = {frames, fingerprint};
  }
  REQUIRE(last.frames > 0);
  for (std::uint32_t polls = static_cast<std::uint32_t>(random() % 20'000); polls > 0; --polls) {
    pollfd one{ends[0], POLLIN, 0};
    (void)poll(&one, 1, 0);
  }
  kill(process, SIGKILL);
  waitpid(process, nullptr, 0);
  while (std::fscanf(lines, "%llu %llu", &frames, &fingerprint) == 2) last = {frames, fingerprint};
  std::fclose(lines);
  return last;
}

TEST_CASE("of a process that is killed at any moment no acknowledged frame is lost, and it can continue") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  const char* const wanted = std::getenv("RINGFENCE_KILLS");
  const int kills = wanted == nullptr ? 12 : std::atoi(wanted);
  const TemporaryDirectory directory;
  for (int i = 0; i < kills; ++i) {
    CAPTURE(i);
    const Acknowledged last = run_and_kill(directory.path().string(), static_cast<std::uint32_t>(random()), random);
    const JournalReader reader(directory.path());
    REQUIRE(reader.frames() >= last.frames);
    std::uint64_t replayed = 0, print = 0;
    const auto check = [&](const World& world) {
      if (world.report().objects == 0) return;  // the snapshot
      ++replayed;
      print = world.frames() == last.frames ? fingerprint(world) : print;
    };
    const World world = reader.restore(journal_world(static_cast<unsigned>(random() % 24)), reader.frames(), check);
    CHECK(replayed <= 8);  // one interval of snapshots
    // A snapshot has no list of ended contacts, so its fingerprint differs.
    if (print != 0) CHECK(print == last.fingerprint);
    if (i % 4 == 3) std::filesystem::remove_all(directory.path());  // begin another one
  }
}

}  // namespace
}  // namespace ringfence::test
