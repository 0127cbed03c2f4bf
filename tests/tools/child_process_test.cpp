#include "child_process.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <string>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

constexpr ChildLimits limits{1, std::size_t{256} << 20, 20};

bool has_no_child() { return waitpid(-1, nullptr, WNOHANG) < 0 && errno == ECHILD; }

ChildResult run(const std::string& how, std::string_view input = {}) {
  return run_child(RINGFENCE_CHILD_PROGRAM, {how}, input, limits);
}

TEST_CASE("run_child returns the answer to its input, whatever the length") {
  const ChildResult none = run("answer");
  CHECK(none.error.empty());
  CHECK(none.output.empty());
  std::string input(5'000'000, 'x');
  input.front() = 'a';
  const ChildResult large = run("answer", input);
  CHECK(large.error.empty());
  std::reverse(input.begin(), input.end());
  CHECK(large.output == input);
}

TEST_CASE("run_child needs no standard input of its own") {
  const int kept = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 10);
  close(STDIN_FILENO);
  const ChildResult result = run("answer", "abc");
  dup2(kept, STDIN_FILENO);
  close(kept);
  CHECK(result.error.empty());
  CHECK(result.output == "cba");
}

TEST_CASE("run_child reports a child that crashes, hangs or throws") {
  CHECK(run("crash").error == "crashed (signal 6)");
  CHECK(run("throw").error == "exited with code 4");
  CHECK(run("hang").error == "did not finish within 1 s");
  CHECK(has_no_child());
}

TEST_CASE("run_child ends a child that waits for longer than its limit or answers too much") {
  ChildLimits tight = limits;
  tight.wall_seconds = 1;
  CHECK(run_child(RINGFENCE_CHILD_PROGRAM, {"wait"}, {}, tight).error == "took longer than 1 s");
  CHECK(has_no_child());
  tight = limits;
  tight.answer_bytes = std::size_t{1} << 20;
  const std::string input(tight.answer_bytes, 'x');
  CHECK(run_child(RINGFENCE_CHILD_PROGRAM, {"answer"}, input, tight).output == input);
  const ChildResult result = run_child(RINGFENCE_CHILD_PROGRAM, {"answer"}, input + "x", tight);
  CHECK(result.error == "answered more than 1 MiB");
  CHECK(result.output.empty());
  CHECK(has_no_child());
}

TEST_CASE("a child cannot raise its limits, and does not get the environment") {
  const std::string hard = run("limits").output;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  CHECK(hard.starts_with("0 2 "));
#else
  CHECK(hard == "0 2 limited");
#endif
  setenv("RINGFENCE_SECRET", "secret", 1);
  const ChildResult result = run("environment");
  unsetenv("RINGFENCE_SECRET");
  CHECK(result.error.empty());
  CHECK_MESSAGE(result.output.find("SECRET") == std::string::npos, result.output);
  CHECK_MESSAGE(("\n" + result.output).find("\nPATH=") == std::string::npos, result.output);
}

TEST_CASE("run_child reports a program that does not exist") {
  CHECK_THROWS_WITH_AS(run_child("/none", {}, {}, limits), "cannot start /none: No such file or directory", Error);
}

TEST_CASE("run_child ends a child that exceeds its memory limit") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  MESSAGE("not tested under sanitizers, which reserve more address space than any limit");
#else
  CHECK(run("memory").error == "needed more than 256 MiB of memory");
#endif
}

}  // namespace
}  // namespace ringfence::tools
