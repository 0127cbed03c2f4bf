#include "base/floating_point.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>
#include <thread>

#include <doctest/doctest.h>
#include <oneapi/tbb/parallel_for.h>

#include "base/caller_environment.hpp"
#include "base/parallel.hpp"

namespace ringfence::base {
namespace {

using test::Caller;
using test::CallerEnvironment;
using test::floating_point_modes;

// Volatile, so that expressions of them are computed at run time, in the environment under test.
volatile double one = 1, three = 3, least_normal = 0x1p-1022;

struct Results {
  double third, minus_third, half_of_least;
  bool operator==(const Results&) const = default;
};

// Not inline: otherwise the compiler may move the arithmetic past a change of the environment.
[[gnu::noinline]] Results compute() { return {one / three, -one / three, least_normal * 0.5}; }

TEST_CASE("arithmetic in a scope is that of the default environment, whatever the caller's") {
  const Results expected = compute();
  const std::uint64_t modes = floating_point_modes();
  for (const Caller caller : test::callers) {
    CAPTURE(std::string(name_of(caller)));
    const CallerEnvironment environment(caller);
    const DefaultFloatingPoint scope;
    CHECK(floating_point_modes() == modes);
    CHECK(compute() == expected);
  }
#if defined(__x86_64__)
  // Without the scope, these environments give other results.
  CHECK_FALSE(call_from(Caller::flushing, compute) == expected);
#endif
  CHECK_FALSE(call_from(Caller::rounding_up, compute) == expected);
}

TEST_CASE("the caller's modes are back after the scope, after nested ones, and after an exception") {
  for (const Caller caller : test::callers) {
    CAPTURE(std::string(name_of(caller)));
    const CallerEnvironment environment(caller);
    const std::uint64_t before = floating_point_modes();
    {
      const DefaultFloatingPoint outer;
      const std::uint64_t within = floating_point_modes();
      {
        const DefaultFloatingPoint inner;
        CHECK(floating_point_modes() == within);
      }
      CHECK(floating_point_modes() == within);
    }
    CHECK(floating_point_modes() == before);
    try {
      const DefaultFloatingPoint scope;
      throw std::runtime_error("out of the scope");
    } catch (const std::runtime_error&) {
    }
    CHECK(floating_point_modes() == before);
  }
}

TEST_CASE(
    "the tasks of parallel_for run in the scope's environment, also where the thread used oneTBB in another before") {
  const std::uint64_t modes = floating_point_modes();
  for (const Caller caller : {Caller::flushing, Caller::rounding_up}) {
    CAPTURE(std::string(name_of(caller)));
    std::size_t other = 0;
    // oneTBB keeps the environment in which a thread first uses it, so each caller is a new thread.
    std::thread([&] {
      const CallerEnvironment environment(caller);
      oneapi::tbb::parallel_for(std::size_t{0}, std::size_t{1}, [](std::size_t) {});
      const DefaultFloatingPoint scope;
      parallel_for(1, 1, [&](std::size_t) { other += floating_point_modes() == modes ? 0 : 1; });
    }).join();
    CHECK(other == 0);
  }
}

}  // namespace
}  // namespace ringfence::base
