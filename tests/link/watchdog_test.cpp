// Makes a test hang on purpose, in its own process, and checks the report.
#include "link/watchdog.hpp"

#include <string>

#include <doctest/doctest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "link/doorbell.hpp"

namespace ringfence::link {
namespace {

/// Two threads wait for each other, and neither rings the other's doorbell.
[[noreturn]] void hang() {
  Watchdog watchdog("two threads that wait for each other", std::chrono::milliseconds(300));
  Doorbell first, second;
  ThreadProgress& first_thread = watchdog.add_thread("one");
  ThreadProgress& second_thread = watchdog.add_thread("the other");
  std::thread other([&] {
    second_thread.note_progress();
    second_thread.set_waiting_for("an answer of one");
    second.wait([] { return false; });
  });
  first_thread.set_waiting_for("an answer of the other");
  first.wait([] { return false; });
  other.join();
  std::_Exit(0);
}

TEST_CASE("a test that hangs ends and reports what each thread waits for") {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDERR_FILENO);
    alarm(20);
    hang();
  }
  REQUIRE(child > 0);
  close(ends[1]);
  std::string report;
  char part[256];
  for (ssize_t bytes; (bytes = read(ends[0], part, sizeof part)) > 0;)
    report.append(part, static_cast<std::size_t>(bytes));
  close(ends[0]);
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 1);
  INFO(report);
  CHECK(report.find("\"two threads that wait for each other\" hangs") != report.npos);
  CHECK(report.find("  one waits for an answer of the other, after 0 steps\n") != report.npos);
  CHECK(report.find("  the other waits for an answer of one, after 1 steps\n") != report.npos);
}

TEST_CASE("a slow test that makes progress is not ended") {
  Watchdog watchdog("a slow one", std::chrono::milliseconds(200));
  ThreadProgress& progress = watchdog.add_thread("the slow one");
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    progress.note_progress();
  }
  progress.set_done();
  CHECK(true);
}

}  // namespace
}  // namespace ringfence::link
