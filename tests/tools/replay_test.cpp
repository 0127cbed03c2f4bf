#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

}  // namespace

TEST_CASE("a recording replays with the digest and the contacts of the run in each deployment") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "run";
  for (const char* warmup : {"0", "15"}) {
    const ProgramResult run =
        test::ringfence(std::string("record --objects 400 --users 20 --frames 12 --warmup ") + warmup +
                        " --nodes 2 --out " + prefix + " --collisions " + prefix + ".csv");
    REQUIRE_MESSAGE(run.code == 0, run.out);
    const std::string digest = test::digest_in(run.out);
    REQUIRE(digest.size() == 16);
    for (const char* deployment : {"user", "user-server", "user-collision"}) {
      const ProgramResult replay =
          test::ringfence("replay --check --scene " + prefix + ".json --motion " + prefix +
                          ".bin --nodes 2 --deployment " + deployment + " --collisions " + prefix + "2.csv");
      REQUIRE_MESSAGE(replay.code == 0, replay.out);
      CHECK_MESSAGE(test::digest_in(replay.out) == digest, "warmup ", warmup, ", ", deployment);
      CHECK(worlds::read_text(prefix + ".csv") == worlds::read_text(prefix + "2.csv"));
    }
  }
}

TEST_CASE("the recorded air traffic replays, agrees with brute force and has contacts") {
  const std::string data = RINGFENCE_DATA;
  const TemporaryFolder folder;
  const ProgramResult result =
      test::ringfence("replay --check --nodes 2 --scene " + data + "/air/scene.json --motion " + data +
                      "/air/motion.csv --json " + (folder / "air.json"));
  REQUIRE_MESSAGE(result.code == 0, result.out);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "air.json"));
  CHECK(report["frames"] == 300);
  CHECK(report["contacts"]["total"] >= 20);
  CHECK(report["check"]["differences"] == 0);
  CHECK(report["contacts"]["label"] == "loss of separation");
  CHECK(result.out.find("\nloss of separation 0.2 per frame, 55 in total\n") != std::string::npos);
}

TEST_CASE(
    "contacts have the label of the scene in the report of a replay, also of a recording, and else their own name") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "walk", files = "replay --scene " + prefix + ".json --motion " + prefix + ".bin";
  REQUIRE(test::ringfence("record --objects 200 --users 5 --frames 3 --warmup 0 --out " + prefix).code == 0);
  CHECK(test::ringfence(files).out.find("\ncontacts    ") != std::string::npos);
  std::string scene = worlds::read_text(prefix + ".json");
  scene.insert(1, "\"contact_label\": \"bump\", ");
  worlds::write_text(prefix + ".json", scene);
  const std::string report = test::ringfence(files + " --resize 1:2").out;
  CHECK(report.find("\nbump        ") != std::string::npos);
  CHECK(report.find("; bump ") != std::string::npos);
  CHECK(report.find("contacts") == std::string::npos);
}

TEST_CASE("with contacts on standard output, the report goes to standard error") {
  const std::string arguments = "run --objects 300 --users 10 --frames 3 --warmup 3 --nodes 1 --collisions -";
  const ProgramResult contacts = test::ringfence(arguments, "2>/dev/null");
  CHECK(contacts.out.starts_with("frame,a,b,px,py,pz,nx,ny,nz,depth\n0,"));
  CHECK(contacts.out.find("digest") == std::string::npos);
  const ProgramResult report = test::ringfence(arguments, "2>&1 >/dev/null");
  CHECK(test::digest_in(report.out).size() == 16);
}

TEST_CASE("JSON report, frame table, timeline and contacts are complete and consistent") {
  const TemporaryFolder folder;
  const ProgramResult result =
      test::ringfence("run --objects 300 --users 10 --frames 7 --warmup 2 --nodes 2 --quiet --json " +
                      (folder / "r.json") + " --frames-csv " + (folder / "f.csv") + " --trace " + (folder / "t.json") +
                      " --collisions " + (folder / "c.csv"));
  REQUIRE_MESSAGE(result.code == 0, result.out);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "r.json"));
  CHECK(report["frames"] == 7);
  CHECK(report["digest"] == test::digest_in(result.out));
  for (const char* key : {"mean", "p50", "p99", "max"}) CHECK(report["frame_ms"][key] > 0.0);
  for (const char* key : {"move", "ingest", "broad_phase", "dispatch", "narrow_phase", "collect", "notify"}) {
    CHECK_MESSAGE(report["stages_ms"].contains(key), key);
  }
  CHECK(report["pairs"]["candidate"] == report["pairs"]["tested"]);
  CHECK(report["pairs"]["tested"] > 0);
  CHECK(report["nodes"].size() == 2);
  for (const char* key : {"busy_ms", "cpu_ms", "wait_ms", "tested"}) CHECK(report["nodes"][0].contains(key));
  CHECK(report["config"]["deployment"] == "user-collision");
  CHECK(report["machine"]["cores"] >= 1);

  CHECK(lines(worlds::read_text(folder / "f.csv")) == 8);
  const std::string contacts = worlds::read_text(folder / "c.csv");
  CHECK(report["contacts"]["total"] == lines(contacts) - 1);

  const auto trace = nlohmann::json::parse(worlds::read_text(folder / "t.json"));
  int frames = 0, spans = 0;
  for (const auto& event : trace["traceEvents"]) {
    const std::string name = event["name"];
    frames += name.starts_with("frame ");
    spans += event["ph"] == "X" && event["dur"] >= 0.0;
  }
  CHECK(frames == 7);
  CHECK(spans > 7 * 4);
}

TEST_CASE("the timeline names its processes, and counts candidates, contacts and the load of each node in each frame") {
  const TemporaryFolder folder;
  REQUIRE(test::ringfence("run --objects 300 --users 10 --frames 5 --warmup 1 --nodes 2 --quiet --json " +
                          (folder / "r.json") + " --trace " + (folder / "t.json"))
              .code == 0);
  std::set<std::string> processes, threads;
  std::map<std::string, std::vector<double>> counters;
  std::set<int> named, used;
  const auto trace = nlohmann::json::parse(worlds::read_text(folder / "t.json"));
  for (const auto& event : trace["traceEvents"]) {
    used.insert(event["pid"].get<int>());
    if (event["name"] == "process_name") {
      processes.insert(event["args"]["name"].get<std::string>());
      named.insert(event["pid"].get<int>());
    }
    if (event["name"] == "thread_name") threads.insert(event["args"]["name"].get<std::string>());
    if (event["ph"] == "C") counters[event["name"]].push_back(event["args"]["value"].get<double>());
  }
  CHECK(processes == std::set<std::string>{"frames", "server", "CD nodes", "users"});
  CHECK(threads == std::set<std::string>{"frames", "server", "node 0", "node 1", "users 0"});
  CHECK(used == named);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "r.json"));
  const auto sum_of = [&counters](const std::string& name) {
    const std::vector<double>& values = counters[name];
    CHECK_MESSAGE(values.size() == 5, name);
    return std::accumulate(values.begin(), values.end(), 0.0);
  };
  CHECK(sum_of("candidates") == report["pairs"]["candidate"]);
  CHECK(sum_of("contacts") == report["contacts"]["total"]);
  for (const int node : {0, 1}) {
    const double mean = report["nodes"][node]["cpu_ms"];
    CHECK(sum_of("load of node " + std::to_string(node) + ", CPU ms") == doctest::Approx(5 * mean));
  }
}

}  // namespace ringfence
