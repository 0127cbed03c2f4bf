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

TEST_CASE(
    "with a limit of contacts all deployments give one digest, agree with brute force and count what is unlisted") {
  const test::TemporaryFolder folder;
  std::string digest;
  const std::string world =
      "run --check --objects 300 --coverage 0.3 --users 10 --frames 8 --warmup 5 --deepest-contacts 2 --json " +
      (folder / "r.json") + " --frames-csv " + (folder / "f.csv");
  for (const char* deployment : deployments) {
    for (const char* placement : {"server", "region"}) {
      for (const int nodes : {0, 1, 3}) {
        const std::string arguments =
            world + " --deployment " + deployment + " --broad-phase " + placement + " --nodes " + std::to_string(nodes);
        const ProgramResult result = test::ringfence(arguments);
        REQUIRE_MESSAGE(result.code == 0, arguments, "\n", result.out);
        CHECK(result.out.find("8 frames agree with brute force") != std::string::npos);
        CHECK(result.out.find("\nunlisted ") != std::string::npos);
        if (digest.empty()) digest = test::digest_in(result.out);
        CHECK_MESSAGE(test::digest_in(result.out) == digest, arguments);
        const auto report = nlohmann::json::parse(worlds::read_text(folder / "r.json"));
        CHECK(report["config"]["deepest_contacts"] == 2);
        CHECK(report["unlisted"] > 100);
        double found = 0;
        for (const auto& node : report["nodes"]) found += 8 * node["contacts"].get<double>();
        CHECK(found == doctest::Approx(report["unlisted"].get<double>() + report["contacts"]["total"].get<double>()));
        const std::string sum = "awk -F, 'NR == 1 {print $NF} NR > 1 {n += $NF} END {print n}' " + (folder / "f.csv");
        CHECK(test::run_shell(sum).out == "unlisted\n" + std::to_string(report["unlisted"].get<int>()) + "\n");
      }
    }
  }
  const ProgramResult refused = test::ringfence("run --deepest-contacts -1");
  CHECK(refused.code == 2);
  CHECK(refused.out.find("--deepest-contacts") != std::string::npos);
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
