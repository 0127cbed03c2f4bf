// The program with its nodes as processes over loopback, compared with nodes as threads.
#include <fstream>
#include <iterator>
#include <string>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;

}  // namespace

TEST_CASE("nodes in other processes find the same contacts in every deployment, placement and number") {
  const std::string world = "run --objects 300 --users 10 --frames 30 --warmup 5 ";
  const std::string expected = test::digest_in(test::ringfence(world + "--nodes 0").out);
  REQUIRE(expected.size() == 16);
  for (const char* deployment : {"user", "user-server", "user-collision"}) {
    for (const char* placement : {"server", "region"}) {
      for (const int nodes : {1, 2, 4, 16}) {
        const std::string arguments = world + "--link dds --deployment " + deployment + " --broad-phase " + placement +
                                      " --nodes " + std::to_string(nodes);
        const ProgramResult answer = test::ringfence(arguments);
        CHECK_MESSAGE(answer.code == 0, arguments, "\n", answer.out);
        CHECK_MESSAGE(test::digest_in(answer.out) == expected, arguments);
      }
    }
  }
}

TEST_CASE("shapes of every kind reach nodes in other processes, and brute force agrees with their contacts") {
  for (const char* shapes : {"sphere", "box", "capsule", "hull", "mixed", "mesh"}) {
    const std::string arguments =
        std::string("run --check --objects 200 --users 5 --frames 4 --warmup 10 --link dds --nodes 2 --shapes ") +
        shapes;
    const ProgramResult answer = test::ringfence(arguments);
    CHECK_MESSAGE(answer.code == 0, arguments, "\n", answer.out);
    CHECK(answer.out.find("4 frames agree with brute force") != std::string::npos);
  }
}

TEST_CASE("a recorded world gives the same result with nodes in other processes as with threads") {
  const std::string air = std::string("replay --scene ") + RINGFENCE_DATA + "/air/scene.json --motion " +
                          RINGFENCE_DATA + "/air/motion.csv --nodes 2 ";
  const std::string expected = test::digest_in(test::ringfence(air).out);
  REQUIRE(expected.size() == 16);
  const ProgramResult answer = test::ringfence(air + "--link dds");
  CHECK_MESSAGE(answer.code == 0, answer.out);
  CHECK(test::digest_in(answer.out) == expected);
}

TEST_CASE("a World that stalls for longer than its lease has its nodes again when it continues") {
  const test::TemporaryFolder folder;
  const std::string status = folder / "status.json";
  const auto read_status = [&] {
    std::ifstream file(status);
    return std::string((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  };
  test::Process world({RINGFENCE_PROGRAM, "run", "--objects", "300", "--users", "4", "--frames", "10000000", "--warmup",
                       "0", "--link", "dds", "--nodes", "2", "--quiet", "--status", status});
  CHECK(test::wait_until([&] { return read_status().find("\"number\": 1") != std::string::npos; }));
  world.signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(4 * test::lease_ms));
  std::string last = read_status();
  world.signal(SIGCONT);
  // The status is written once a second: the third one includes all losses of that time.
  for (int i = 0; i < 3; ++i) {
    REQUIRE(test::wait_until([&] { return read_status() != last; }, 60));
    last = read_status();
  }
  CHECK(test::wait_until([&] { return read_status().find("\"number\": 1") != std::string::npos; }, 60));
  CHECK(!world.has_ended());
}

TEST_CASE("a World that no node joins prints advice and exits with 2") {
  const ProgramResult answer = test::ringfence(
      "run --objects 50 --users 1 --link dds --wait-nodes 2 --wait-ms 200 "
      "--domain 77 --interface lo");
  CHECK(answer.code == 2);
  CHECK(answer.out.find("0 of 2 nodes joined domain 77 within 200 ms: start `ringfence node --domain 77`") !=
        std::string::npos);
}

TEST_CASE("an unavailable network setting is refused with what to change") {
  CHECK(test::ringfence("node --interface nosuch0 --domain 9").out.find("check that the interface exists") !=
        std::string::npos);
  CHECK(test::ringfence("run --wait-nodes 2").out.find("expected with --link dds") != std::string::npos);
  CHECK(test::ringfence("run --link dds --nodes 0").out.find("expected at least 1 with --link dds") !=
        std::string::npos);
}

}  // namespace ringfence
