// SIGINT and SIGTERM end the program with its report and with complete files.
#include <algorithm>
#include <csignal>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "tools/running_program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::RunningProgram;
using test::TemporaryFolder;
using worlds::read_text;

std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

const std::vector<std::string> small_world{"--objects", "400", "--users", "10", "--warmup", "2", "--nodes", "2"};

std::vector<std::string> command_with(const std::string& command, const std::vector<std::string>& options,
                                      const std::vector<std::string>& more = {}) {
  std::vector<std::string> all{command};
  all.insert(all.end(), options.begin(), options.end());
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace

TEST_CASE("SIGTERM ends a run with code 3, a report and complete files, equal to a run of so many frames") {
  const TemporaryFolder folder;
  // The contacts of so many frames do not fit into a pipe, so the run waits for the reader.
  RunningProgram run(
      command_with("run", small_world,
                   {"--frames", "5000", "--collisions", "-", "--resize", "4000:3", "--json", folder / "r.json",
                    "--frames-csv", folder / "f.csv", "--trace", folder / "t.json", "--status", folder / "s.json"}),
      folder / "err");
  REQUIRE(run.started());
  std::string contacts = run.read_some();
  run.signal(SIGTERM);
  contacts += run.read_all();
  CHECK(run.wait() == 3);

  const auto report = nlohmann::json::parse(read_text(folder / "r.json"));
  const std::size_t frames = report["frames"];
  CHECK(report["ended_by"] == "SIGTERM");
  CHECK(report["config"]["frames"] == 5000);
  CHECK(report["resizes"].empty());
  REQUIRE(frames >= 1);
  REQUIRE(frames < 4000);
  const std::string count = std::to_string(frames);
  CHECK(read_text(folder / "err").find(count + " of 5000 frames counted after 2 of warm-up: ended by SIGTERM\n") !=
        std::string::npos);
  CHECK(lines(contacts) == 1 + report["contacts"]["total"].get<std::size_t>());
  CHECK(contacts.ends_with('\n'));
  const std::string rows = read_text(folder / "f.csv");
  CHECK(lines(rows) == 1 + frames);
  CHECK(rows.ends_with('\n'));
  CHECK(!nlohmann::json::parse(read_text(folder / "t.json"))["traceEvents"].empty());
  CHECK(nlohmann::json::parse(read_text(folder / "s.json"))["ended_by"] == "SIGTERM");

  const test::ProgramResult whole =
      test::ringfence("run --objects 400 --users 10 --warmup 2 --nodes 2 --frames " + count);
  CHECK(test::digest_in(whole.out) == report["digest"]);
}

TEST_CASE("SIGINT ends a replay with code 3, a report and complete files") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "walk";
  REQUIRE(test::ringfence("record --objects 400 --users 10 --frames 300 --warmup 0 --out " + prefix).code == 0);
  RunningProgram replay({"replay", "--scene", prefix + ".json", "--motion", prefix + ".bin", "--collisions", "-",
                         "--check", "--json", folder / "r.json"},
                        folder / "err");
  REQUIRE(replay.started());
  std::string contacts = replay.read_some();
  replay.signal(SIGINT);
  contacts += replay.read_all();
  CHECK(replay.wait() == 3);
  const auto report = nlohmann::json::parse(read_text(folder / "r.json"));
  CHECK(report["ended_by"] == "SIGINT");
  CHECK(report["frames"] < 300);
  CHECK(report["check"]["frames"] == report["frames"]);
  CHECK(lines(contacts) == 1 + report["contacts"]["total"].get<std::size_t>());
  CHECK(read_text(folder / "err").find(": ended by SIGINT\n") != std::string::npos);
}

TEST_CASE("a complete run says that no signal has ended it") {
  const TemporaryFolder folder;
  REQUIRE(test::ringfence("run --objects 200 --users 5 --frames 3 --warmup 0 --json " + (folder / "r.json")).code == 0);
  CHECK(nlohmann::json::parse(read_text(folder / "r.json"))["ended_by"].is_null());
}

TEST_CASE("the second signal ends a run at once") {
  const TemporaryFolder folder;
  RunningProgram run(command_with("run", small_world, {"--frames", "5000", "--collisions", "-"}), folder / "err");
  REQUIRE(run.started());
  REQUIRE(!run.read_some().empty());
  run.signal(SIGTERM);
  run.signal(SIGINT);
  // The run cannot end by itself, because its output is not read.
  const int code = run.wait();
  CHECK((code == -SIGTERM || code == -SIGINT));
}

TEST_CASE("a signal ends a soak with code 3 and its report") {
  const TemporaryFolder folder;
  RunningProgram soak(command_with("run", small_world, {"--soak", "60", "--node-deadline-ms", "60"}), folder / "err");
  REQUIRE(soak.started());
  REQUIRE(soak.wait_until_caught(SIGTERM));
  soak.signal(SIGTERM);
  const std::string report = soak.read_all();
  CHECK(soak.wait() == 3);
  CHECK(report.find(" of 60.0: ended by SIGTERM, ") != std::string::npos);
  CHECK(report.find("all checks passed") != std::string::npos);
}

TEST_CASE("a signal ends scale with code 3 and the runs that are complete") {
  const TemporaryFolder folder;
  RunningProgram scale({"scale", "--objects", "2000", "--frames", "100000", "--warmup", "0", "--nodes", "1", "--json",
                        folder / "s.json", "--csv", folder / "s.csv", "--model", "today"},
                       folder / "err");
  REQUIRE(scale.started());
  REQUIRE(scale.wait_until_caught(SIGINT));
  scale.signal(SIGINT);
  const std::string report = scale.read_all();
  CHECK(scale.wait() == 3);
  CHECK(report.find("ended by SIGINT: the table has the runs that were complete") != std::string::npos);
  const auto json = nlohmann::json::parse(read_text(folder / "s.json"));
  CHECK(json["ended_by"] == "SIGINT");
  CHECK(json["runs"].empty());
  CHECK(lines(read_text(folder / "s.csv")) == 1);
}

TEST_CASE("a signal ends a node that has no world with code 0, and the node says why it ended") {
  const TemporaryFolder folder;
  for (const int number : {SIGTERM, SIGINT}) {
    RunningProgram node({"node", "--interface", "lo", "--domain", "187"}, folder / "err");
    REQUIRE(node.started());
    if (!node.wait_until_caught(number)) {  // a build without Cyclone DDS
      CHECK(node.wait() == 2);
      return;
    }
    node.signal(number);
    CHECK(node.wait() == 0);
    CHECK(read_text(folder / "err").find(": ended: drained\n") != std::string::npos);
  }
}

}  // namespace ringfence
