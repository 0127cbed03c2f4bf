// A hang is made on purpose, in a process of its own, and what is said of it is read.
#include "link/watchdog.hpp"

#include <string>

#include <doctest/doctest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "link/doorbell.hpp"

namespace ringfence::link {
namespace {

/// Two threads wait for each other: one for a bell that the other would ring after its own.
[[noreturn]] void hang() {
  Watchdog dog("two that wait for each other", std::chrono::milliseconds(300));
  Doorbell first, second;
  Post& ones = dog.post("one");
  Post& others = dog.post("the other");
  std::thread other([&] {
    others.moves();
    others.waits_for("an answer of one");
    second.wait([] { return false; });
  });
  ones.waits_for("an answer of the other");
  first.wait([] { return false; });
  other.join();
  std::_Exit(0);
}

TEST_CASE("a test that hangs ends, and says who waits for what") {
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
  std::string said;
  char part[256];
  for (ssize_t bytes; (bytes = read(ends[0], part, sizeof part)) > 0;)
    said.append(part, static_cast<std::size_t>(bytes));
  close(ends[0]);
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 1);
  INFO(said);
  CHECK(said.find("\"two that wait for each other\" hangs") != said.npos);
  CHECK(said.find("  one waits for an answer of the other, after 0 steps\n") != said.npos);
  CHECK(said.find("  the other waits for an answer of one, after 1 steps\n") != said.npos);
}

TEST_CASE("a test that goes on, however slowly, is left alone") {
  Watchdog dog("a slow one", std::chrono::milliseconds(200));
  Post& post = dog.post("the slow one");
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    post.moves();
  }
  post.leaves();
  CHECK(true);
}

}  // namespace
}  // namespace ringfence::link
