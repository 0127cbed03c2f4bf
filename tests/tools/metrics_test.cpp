// --metrics serves the figures of a run while it runs.
#include <csignal>
#include <regex>
#include <string>

#include <doctest/doctest.h>
#include <sched.h>

#include "tools/program.hpp"
#include "tools/running_program.hpp"

namespace ringfence {

TEST_CASE("a run serves its metrics at a loopback address while it runs") {
  const test::TemporaryFolder folder;
  const std::string errors = folder / "errors";
  test::RunningProgram program(
      {"run", "--objects", "500", "--nodes", "1", "--quiet", "--frames", "10000000", "--metrics", "127.0.0.1:0"},
      errors);
  REQUIRE(program.started());
  REQUIRE(program.wait_until_caught(SIGTERM));
  const auto match = [&](const std::string& command, const char* pattern) {
    std::smatch found;
    for (;;) {
      const std::string text = test::run_shell(command).out;
      if (std::regex_search(text, found, std::regex(pattern))) return found[1].str();
      sched_yield();
    }
  };
  const std::string port = match("cat " + errors, R"(metrics at http://127\.0\.0\.1:(\d+)/metrics)");
  const auto get = [&](const std::string& path) {
    return "bash -c 'exec 3<>/dev/tcp/127.0.0.1/" + port + "; printf \"GET " + path +
           " HTTP/1.0\\r\\n\\r\\n\" >&3; cat <&3'";
  };
  CHECK(match(get("/metrics"), R"((?:^|\n)ringfence_objects (\d+))") == "500");
  CHECK(match(get("/play"), R"(HTTP/1\.[01] (\d+))") == "404");
  CHECK(match(get("/healthz"), R"(HTTP/1\.[01] (\d+))") == "200");
  program.signal(SIGTERM);
  static_cast<void>(program.read_all());
  CHECK(program.wait() == 3);
}

TEST_CASE("metrics are refused at an address that is no address, or that other machines reach") {
  const auto refused = [](const std::string& address, const std::string& message) {
    const test::ProgramResult result = test::ringfence("run --objects 100 --users 1 --frames 1 --metrics " + address);
    CHECK(result.code == 2);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, result.out);
  };
  refused("9100", "--metrics: found 9100; expected HOST:PORT");
  refused("0.0.0.0:0", "0.0.0.0 is open to other machines");
}

}  // namespace ringfence
