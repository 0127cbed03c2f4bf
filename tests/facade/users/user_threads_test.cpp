#include "facade/users/user_threads.hpp"

#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

WorldConfig config_with_threads() {
  WorldConfig config;
  config.nodes = 1;
  config.user_threads = 3;
  config.deadlines.user_ms = 1e-6;  // so that no time has to pass between two checks
  return config;
}

TEST_CASE("without threads one entry stands for the thread that calls World") {
  WorldConfig config;
  config.nodes = 0;
  config.user_threads = 3;
  WorldState state(config);
  UserThreads threads(state);
  threads.start();
  CHECK(threads.size() == 1);
  CHECK(threads.bell(0) == nullptr);
  CHECK(threads.at(0).worker == nullptr);
}

TEST_CASE("a thread has stalled if two checks find it in the same move") {
  WorldState state(config_with_threads());
  UserThreads threads(state);
  threads.start();
  REQUIRE(threads.size() == 3);
  using Indices = std::vector<std::size_t>;
  // The threads have no roles, so the test enters the moves.
  threads.at(0).watch.enter(0);
  threads.at(2).watch.enter(2);
  CHECK(threads.find_stalled() == Indices{});
  CHECK(threads.at(0).watch.leave());
  CHECK(threads.find_stalled() == Indices{2});
  threads.at(0).watch.enter(0);
  CHECK(threads.at(2).watch.leave());
  threads.at(2).watch.enter(2);  // the next move of the same user node
  CHECK(threads.find_stalled() == Indices{});
  CHECK(threads.find_stalled() == Indices{0, 2});
}

TEST_CASE("a second check within a quarter of the deadline finds nothing") {
  WorldConfig config = config_with_threads();
  config.deadlines.user_ms = 1e9;
  WorldState state(config);
  UserThreads threads(state);
  threads.start();
  threads.at(0).watch.enter(0);
  for (int check = 0; check < 5; ++check) CHECK(threads.find_stalled().empty());
}

TEST_CASE("a replacement has a thread of its own, and its first check finds no move") {
  WorldState state(config_with_threads());
  UserThreads threads(state);
  threads.start();
  threads.at(1).watch.enter(1);
  (void)threads.find_stalled();
  const link::Doorbell* bell = threads.bell(1);
  const auto stalled = threads.replace(1, threads.start_replacement(), {});
  CHECK(&stalled->worker->bell() == bell);
  CHECK(threads.bell(1) != bell);
  CHECK(threads.find_stalled().empty());
}

}  // namespace
}  // namespace ringfence::facade
