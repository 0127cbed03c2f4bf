#include "facade/threads/worker_starter.hpp"

#include <string>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

namespace ringfence::facade {
namespace {

TEST_CASE("one start fails after the number of successful ones that a test gives") {
  const WorldConfig config;
  Halt halt(nullptr);
  WorkerStarter starter(config, halt);
  Worker workers[4];
  starter.fail_after(2);
  CHECK(starter.start(workers[0]));
  CHECK(starter.start(workers[1]));
  CHECK(!starter.start(workers[2]));
  CHECK(starter.start(workers[2]));
  CHECK(starter.start(workers[3]));
}

TEST_CASE("the error of a missing thread names the threads of the configuration and the limits of the system") {
  WorldConfig config;
  config.nodes = 12;
  config.user_threads = 5;
  Halt halt(nullptr);
  WorkerStarter starter(config, halt);
  starter.fail_after(0);
  Worker worker;
  std::string text;
  try {
    starter.must_start(worker);
  } catch (const Error& error) {
    text = error.what();
  }
  CHECK(text.find("12 CD nodes") != std::string::npos);
  CHECK(text.find("5 user threads") != std::string::npos);
  CHECK(text.find("ulimit -u") != std::string::npos);
}

}  // namespace
}  // namespace ringfence::facade
