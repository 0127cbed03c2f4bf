// The program with its nodes as processes over loopback, compared with nodes as threads.
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
