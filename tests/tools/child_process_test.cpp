#include "child_process.hpp"

#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::tools {
namespace {

constexpr ChildLimits limits{1, std::size_t{256} << 20};

TEST_CASE("what work in a child process returns comes back, however long") {
  const ChildResult none = run_in_child([] { return std::string(); }, limits);
  CHECK(none.end.empty());
  CHECK(none.output.empty());
  const ChildResult much = run_in_child([] { return std::string(5'000'000, 'x'); }, limits);
  CHECK(much.end.empty());
  CHECK(much.output == std::string(5'000'000, 'x'));
}

TEST_CASE("work that crashes, hangs or throws in a child process is told from work that returns") {
  CHECK(run_in_child([]() -> std::string { std::abort(); }, limits).end == "crashed (signal 6)");
  CHECK(run_in_child([]() -> std::string { throw std::runtime_error("no"); }, limits).end == "ended with 4");
  const ChildResult endless = run_in_child(
      []() -> std::string {
        volatile bool on = true;  // clang sees through a local atomic, and a loop without effect may be left out
        while (on) {
        }
        return "";
      },
      limits);
  CHECK(endless.end == "did not come to an end within 1 s");
}

TEST_CASE("work that wants more memory than its child process may have is refused it") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  MESSAGE("sanitizers keep more address space than any limit: not tried");
#else
  const ChildResult answer = run_in_child(
      [] {
        std::vector<char> much(std::size_t{1} << 30, 'x');
        const volatile char* middle = much.data() + much.size() / 2;  // else clang does without the memory
        return std::string(1, *middle);
      },
      limits);
  CHECK(answer.end == "wanted more than 256 MiB of memory");
#endif
}

}  // namespace
}  // namespace ringfence::tools
