#include "child_process.hpp"

#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::tools {
namespace {

constexpr ChildLimits limits{1, std::size_t{256} << 20};

TEST_CASE("run_in_child returns the result of its work, whatever its length") {
  const ChildResult none = run_in_child([] { return std::string(); }, limits);
  CHECK(none.error.empty());
  CHECK(none.output.empty());
  const ChildResult large = run_in_child([] { return std::string(5'000'000, 'x'); }, limits);
  CHECK(large.error.empty());
  CHECK(large.output == std::string(5'000'000, 'x'));
}

TEST_CASE("run_in_child reports work that crashes, hangs or throws") {
  CHECK(run_in_child([]() -> std::string { std::abort(); }, limits).error == "crashed (signal 6)");
  CHECK(run_in_child([]() -> std::string { throw std::runtime_error("no"); }, limits).error == "exited with code 4");
  const ChildResult endless = run_in_child(
      []() -> std::string {
        volatile bool on = true;  // otherwise the compiler may remove a loop without side effects
        while (on) {
        }
        return "";
      },
      limits);
  CHECK(endless.error == "did not finish within 1 s");
}

TEST_CASE("run_in_child ends work that exceeds its memory limit") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  MESSAGE("not tested under sanitizers, which reserve more address space than any limit");
#else
  const ChildResult result = run_in_child(
      [] {
        std::vector<char> much(std::size_t{1} << 30, 'x');
        const volatile char* middle = much.data() + much.size() / 2;  // otherwise clang removes the allocation
        return std::string(1, *middle);
      },
      limits);
  CHECK(result.error == "needed more than 256 MiB of memory");
#endif
}

}  // namespace
}  // namespace ringfence::tools
