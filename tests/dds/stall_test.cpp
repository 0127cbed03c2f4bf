// Processes of a world that stall for longer than their leases, and what a node does while nothing answers it.
#include <array>
#include <chrono>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <thread>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

void sleep_ms(double ms) { std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(ms)); }

/// A process with a World and two processes with its nodes.
class StallingWorld {
 public:
  explicit StallingWorld(std::uint32_t domain)
      : world_({RINGFENCE_PROGRAM,
                "run",
                "--objects",
                "300",
                "--users",
                "4",
                "--frames",
                "10000000",
                "--warmup",
                "0",
                "--link",
                "dds",
                "--interface",
                "lo",
                "--domain",
                std::to_string(domain),
                "--wait-nodes",
                "2",
                "--lease-ms",
                std::to_string(test::lease_ms),
                "--quiet",
                "--status",
                folder_ / "status.json"}),
        first_(node_arguments(domain)),
        second_(node_arguments(domain)) {
    CHECK(has_all_nodes_again());
  }

  std::array<test::Process*, 3> processes() { return {&world_, &first_, &second_}; }
  test::Process& world() { return world_; }

  static void stall(const test::Process& process, double leases) {
    process.signal(SIGSTOP);
    sleep_ms(leases * test::lease_ms);
    process.signal(SIGCONT);
  }

  /// Whether a status that is written after a time in which losses are noticed has both nodes, now or soon.
  bool has_all_nodes_again() {
    // The status is written once a second: the third one includes all losses of the time before this call.
    std::string last = status();
    for (int i = 0; i < 3; ++i) {
      if (!test::wait_until([&] { return status() != last; }, 60)) {
        return false;
      }
      last = status();
    }
    return test::wait_until([&] { return members() == 2; }, 60);
  }

 private:
  static std::vector<std::string> node_arguments(std::uint32_t domain) {
    return {RINGFENCE_PROGRAM, "node", "--quiet", "--interface", "lo", "--domain", std::to_string(domain)};
  }

  std::string status() const {
    std::ifstream file(folder_ / "status.json");
    return std::string((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  }

  std::size_t members() const {
    const std::string text = status();
    constexpr std::string_view key = "\"number\": ";
    std::size_t count = 0;
    for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + 1)) {
      ++count;
    }
    return count;
  }

  test::TemporaryFolder folder_;
  test::Process world_, first_, second_;
};

}  // namespace

TEST_CASE("a World that stalls for longer than its lease has its nodes again when it continues") {
  StallingWorld processes(175);
  StallingWorld::stall(processes.world(), 4);
  CHECK(processes.has_all_nodes_again());
  CHECK(!processes.world().has_ended());
}

TEST_CASE("a World and nodes that stall again and again for longer than their leases find each other at the end") {
  StallingWorld processes(176);
  std::mt19937_64 random(std::random_device{}());
  for (int stall = 0; stall < 24; ++stall) {
    const test::Process& process = *processes.processes()[random() % 3];
    StallingWorld::stall(process, 0.5 + static_cast<double>(random() % 40) / 10);
    sleep_ms(static_cast<double>(random() % 4 * (random() % 40)));
  }
  CHECK(processes.has_all_nodes_again());
  CHECK(!processes.world().has_ended());
}

}  // namespace ringfence
