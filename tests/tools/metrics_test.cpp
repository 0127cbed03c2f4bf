// --metrics serves the figures of a run while it runs.
#include <csignal>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>
#include <sched.h>

#include "tools/program.hpp"
#include "tools/running_program.hpp"

namespace ringfence {

namespace {

/// Repeats a shell command until its output matches, and returns the first group.
std::string wait_for_match(const std::string& command, const std::string& pattern) {
  std::smatch found;
  for (;;) {
    const std::string text = test::run_shell(command).out;
    if (std::regex_search(text, found, std::regex(pattern))) return found[1].str();
    sched_yield();
  }
}

/// A program with --metrics 127.0.0.1:0.
class MeasuredProgram {
 public:
  explicit MeasuredProgram(std::vector<std::string> arguments)
      : program_((arguments.insert(arguments.end(), {"--metrics", "127.0.0.1:0"}), std::move(arguments)),
                 folder_ / "errors") {
    REQUIRE(program_.started());
  }
  /// Whether the program listens. False if it ends before.
  bool listens() {
    if (!program_.wait_until_caught(SIGTERM)) return false;
    port_ = wait_for_match("cat " + folder_ / "errors", R"(metrics at http://127\.0\.0\.1:(\d+)/metrics)");
    return true;
  }
  std::string wait_for(const std::string& path, const std::string& pattern) const {
    return wait_for_match("bash -c 'exec 3<>/dev/tcp/127.0.0.1/" + port_ + "; printf \"GET " + path +
                              " HTTP/1.0\\r\\n\\r\\n\" >&3; cat <&3'",
                          pattern);
  }
  int stop() {
    program_.signal(SIGTERM);
    static_cast<void>(program_.read_all());
    return program_.wait();
  }
  test::RunningProgram& program() { return program_; }

 private:
  test::TemporaryFolder folder_;
  test::RunningProgram program_;
  std::string port_;
};

}  // namespace

TEST_CASE("a run serves its metrics at a loopback address while it runs") {
  MeasuredProgram run({"run", "--objects", "500", "--nodes", "1", "--quiet", "--frames", "10000000"});
  REQUIRE(run.listens());
  CHECK(run.wait_for("/metrics", R"((?:^|\n)ringfence_objects (\d+))") == "500");
  CHECK(run.wait_for("/play", R"(HTTP/1\.[01] (\d+))") == "404");
  CHECK(run.wait_for("/healthz", R"(HTTP/1\.[01] (\d+))") == "200");
  CHECK(run.stop() == 3);
}

TEST_CASE("a node process serves its own metrics, also between two worlds") {
  MeasuredProgram node({"node", "--quiet", "--interface", "lo", "--domain", "173"});
  if (!node.listens()) {  // a build without Cyclone DDS
    CHECK(node.program().wait() == 2);
    return;
  }
  CHECK(node.wait_for("/metrics", R"(\nringfence_node_frames_total (\d+))") == "0");
  for (const char* frames : {"25", "50"}) {
    const test::ProgramResult run = test::ringfence(
        "run --objects 500 --deployment user-collision --link dds --wait-nodes 1 --interface lo --domain 173 --frames "
        "20 "
        "--warmup 5 --quiet");
    CHECK_MESSAGE(run.code == 0, run.out);
    CHECK(node.wait_for("/metrics", std::string(R"(\nringfence_node_frames_total ()") + frames + R"()\n)") == frames);
  }
  CHECK(node.wait_for("/metrics", R"(\nringfence_node_serves (0)\n)") == "0");
  CHECK(std::stod(node.wait_for("/metrics", R"(\nringfence_node_cpu_seconds_total (\S+))")) > 0);
  CHECK(node.wait_for("/metrics", R"((gateway|_serves))") == "_serves");  // no counters of clients
  CHECK(node.stop() == 0);
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
