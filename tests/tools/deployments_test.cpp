#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;

constexpr const char* deployments[] = {"user", "user-server", "user-collision"};

}  // namespace

TEST_CASE("all deployments, placements and node counts give one digest and agree with brute force") {
  for (const char* shapes : {"sphere", "mixed"}) {
    std::string digest;
    for (const char* deployment : deployments) {
      for (const char* placement : {"server", "region"}) {
        for (const int nodes : {0, 1, 3}) {
          const std::string arguments =
              std::string("run --check --objects 300 --users 10 --frames 8 --warmup 20 --shapes ") + shapes +
              " --deployment " + deployment + " --broad-phase " + placement + " --nodes " + std::to_string(nodes);
          const ProgramResult result = test::ringfence(arguments);
          REQUIRE_MESSAGE(result.code == 0, arguments, "\n", result.out);
          CHECK(result.out.find("8 frames agree with brute force") != std::string::npos);
          if (digest.empty()) digest = test::digest_in(result.out);
          CHECK_MESSAGE(digest.size() == 16, arguments);
          CHECK_MESSAGE(test::digest_in(result.out) == digest, arguments);
        }
      }
    }
  }
}

TEST_CASE("4000 objects have 1600 to 3500 contacts per frame for each shape setting") {
  const test::TemporaryFolder folder;
  for (const char* shapes : {"sphere", "box", "capsule", "hull", "mixed"}) {
    const ProgramResult result =
        test::ringfence(std::string("run --frames 8 --nodes 1 --shapes ") + shapes + " --json " + (folder / "r.json"));
    REQUIRE_MESSAGE(result.code == 0, result.out);
    const auto report = nlohmann::json::parse(worlds::read_text(folder / "r.json"));
    const double mean = report["contacts"]["mean"];
    CHECK_MESSAGE(mean > 1600, shapes);
    CHECK_MESSAGE(mean < 3500, shapes);
    CHECK(report["pairs"]["candidate"] == report["pairs"]["accepted"]);
  }
}

TEST_CASE("the digest depends on the seed, but not on user threads, interest or thread pinning") {
  const std::string arguments = "run --objects 300 --frames 5 --warmup 5 --nodes 2 --users 10";
  const std::string digest = test::digest_in(test::ringfence(arguments).out);
  REQUIRE(digest.size() == 16);
  CHECK(test::digest_in(test::ringfence(arguments + " --seed 2").out) != digest);
  CHECK(test::digest_in(test::ringfence(arguments + " --user-threads 3").out) == digest);
  CHECK(test::digest_in(test::ringfence(arguments + " --interest 3 --pin --quiet").out) == digest);
}

}  // namespace ringfence
