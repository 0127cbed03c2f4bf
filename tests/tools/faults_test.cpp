#include "faults.hpp"

#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

constexpr const char* world = "run --objects 400 --users 8 --frames 20 --warmup 2 --check --node-deadline-ms 100 ";

}  // namespace

TEST_CASE("injected failures of nodes do not change the digest, and the report lists them") {
  const TemporaryFolder folder;
  const ProgramResult still = test::ringfence(std::string(world) + "--nodes 3 --json " + (folder / "still.json"));
  REQUIRE(still.code == 0);
  const auto expected = nlohmann::json::parse(worlds::read_text(folder / "still.json"));
  CHECK(expected["lost"].empty());
  const ProgramResult failed =
      test::ringfence(std::string(world) + "--nodes 3 --fail 4:2:colliding,9:0:moving --fail 15:1:ending " + "--json " +
                      (folder / "failed.json"));
  REQUIRE_MESSAGE(failed.code == 0, failed.out);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "failed.json"));
  CHECK(report["digest"] == expected["digest"]);
  CHECK(report["check"]["differences"] == 0);
  REQUIRE(report["lost"].size() == 3);
  const int frames[] = {4, 9, 15}, nodes[] = {2, 0, 1};
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(report["lost"][i]["frame"] == frames[i]);
    CHECK(report["lost"][i]["node"] == nodes[i]);
    CHECK(report["lost"][i]["kind"] == "cd");
    CHECK(report["lost"][i]["frame_ms"] >= 100.0);
  }
  CHECK(failed.out.find("lost        frame 4: CD node 2; the frame took") != std::string::npos);
}

TEST_CASE("nodes that fail inside a stage do not change the digest") {
  const TemporaryFolder folder;
  const ProgramResult still = test::ringfence(std::string(world) + "--nodes 5 --json " + (folder / "still.json"));
  REQUIRE(still.code == 0);
  const auto expected = nlohmann::json::parse(worlds::read_text(folder / "still.json"));
  const ProgramResult failed = test::ringfence(
      std::string(world) + "--nodes 5 --fail 3:2:model,6:1:kernel,9:0:publication,12:3:hand-over --json " +
      (folder / "failed.json"));
  REQUIRE_MESSAGE(failed.code == 0, failed.out);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "failed.json"));
  CHECK(report["digest"] == expected["digest"]);
  CHECK(report["check"]["differences"] == 0);
  CHECK(report["lost"].size() >= 3);  // a node that hands nothing over does not stop there
}

TEST_CASE("invalid faults are refused with what is expected") {
  const auto refused = [](const std::string& arguments, const std::string& words) {
    const ProgramResult result = test::ringfence("run --objects 100 --users 2 --frames 5 " + arguments);
    CAPTURE(arguments);
    CAPTURE(result.out);
    CHECK(result.code == 2);
    CHECK(result.out.find(words) != std::string::npos);
  };
  refused("--nodes 2 --fail 1:0:moving", "--node-deadline-ms");
  refused("--nodes 0 --node-deadline-ms 50 --fail 1:0:moving", "--nodes 0");
  refused("--nodes 2 --node-deadline-ms 50 --fail 5:0:moving", "0 to 4");
  refused("--nodes 2 --node-deadline-ms 50 --fail 1:2:moving", "a node that exists in that frame");
  refused("--nodes 2 --node-deadline-ms 50 --fail 1:0:dreaming", "moving, gathering, colliding");
  refused("--nodes 2 --node-deadline-ms 50 --fail 1:moving", "FRAME:NODE:STAGE");
  refused("--nodes 2 --node-deadline-ms 50 --fail 1:u0:model", "--user-deadline-ms");
  refused("--nodes 2 --user-deadline-ms 50 --fail 1:u2:model", "a user node that exists in that frame");
  refused("--nodes 2 --user-deadline-ms 50 --fail 1:u1:moving", "model or publication");
  refused("--nodes 2 --node-deadline-ms -1", "--node-deadline-ms");
}

}  // namespace ringfence
