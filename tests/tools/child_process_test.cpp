#include "child_process.hpp"

#include <algorithm>
#include <string>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

constexpr ChildLimits limits{1, std::size_t{256} << 20};

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
