#include "resize.hpp"

#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "ringfence/error.hpp"
#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

nlohmann::json run_with_json(const std::string& arguments) {
  const TemporaryFolder folder;
  const ProgramResult result = test::ringfence(arguments + " --json " + (folder / "r.json"));
  REQUIRE_MESSAGE(result.code == 0, arguments, "\n", result.out);
  return nlohmann::json::parse(worlds::read_text(folder / "r.json"));
}

}  // namespace

TEST_CASE("scheduled resizes do not change the digest, and the report has the cost of the frames around them") {
  const std::string arguments = "run --objects 500 --users 10 --frames 24 --warmup 4 --check --nodes 2";
  const auto still = run_with_json(arguments);
  CHECK_FALSE(still.contains("resizes"));
  for (const char* placement : {"server", "region"}) {
    const auto resized = run_with_json(arguments + " --resize 20:3 --resize 5:6,6:1,0:4 --broad-phase " + placement);
    CHECK(resized["digest"] == still["digest"]);
    CHECK(resized["contacts"]["total"] == still["contacts"]["total"]);
    CHECK(resized["check"]["differences"] == 0);
    const auto& resizes = resized["resizes"];
    REQUIRE(resizes.size() == 4);
    const int frames[] = {0, 5, 6, 20}, from[] = {2, 4, 6, 1}, to[] = {4, 6, 1, 3};
    for (std::size_t i = 0; i < 4; ++i) {
      CHECK(resizes[i]["frame"] == frames[i]);
      CHECK(resizes[i]["from"] == from[i]);
      CHECK(resizes[i]["to"] == to[i]);
      CHECK(resizes[i]["handed_over"] > 0);
      CHECK(resizes[i]["frame_ms"]["at"] > 0.0);
      CHECK(resizes[i]["frame_ms"]["next"] > 0.0);
      CHECK(resizes[i]["frame_ms"]["after"] > 0.0);
    }
    CHECK(resizes[0]["frame_ms"]["before"] == 0.0);
    CHECK(resizes[1]["frame_ms"]["before"] > 0.0);
  }
}

TEST_CASE("ResizeSchedule reports the frames before, at and after each resize") {
  const std::vector<tools::Resize> resizes = {{1, 4}, {10, 2}};
  tools::ResizeSchedule resize_schedule(resizes, 3);
  for (std::uint32_t frame = 0; frame < 12; ++frame) {
    FrameReport report;
    report.frame_ms = frame;
    report.contacts = 100 + frame;
    report.handed_over = 1000 + frame;
    resize_schedule.add_frame(report);
  }
  const auto figures = resize_schedule.figures();
  REQUIRE(figures.size() == 2);
  CHECK(figures[0].from == 3);
  CHECK(figures[0].frame_ms.before == 0);
  CHECK(figures[0].frame_ms.at == 1);
  CHECK(figures[0].frame_ms.next == 2);
  CHECK(figures[0].frame_ms.after == doctest::Approx(6.5));  // 3 to 10
  CHECK(figures[1].from == 4);
  CHECK(figures[1].to == 2);
  CHECK(figures[1].frame_ms.before == doctest::Approx(5.5));  // 2 to 9
  CHECK(figures[1].contacts.at == 110);
  CHECK(figures[1].contacts.next == 111);
  CHECK(figures[1].contacts.after == 0);
  CHECK(figures[1].handed_over == 1010);
}

TEST_CASE("an invalid --resize is refused with the reason") {
  for (const char* text : {"", "5", "5:", ":5", "5:0", "5:1025", "-1:2", "5:2,", "5:2,,6:3", "5:2 6:3", "5:2;6:3",
                           "x:2", "5:2x", "99999999999:2", "5:99999999999"}) {
    CHECK_THROWS_AS_MESSAGE(tools::parse_resizes(text), Error, text);
  }
  const auto check_refused = [](const std::string& arguments, const std::string& message) {
    const ProgramResult result = test::ringfence("run --objects 200 --users 10 --frames 10 --warmup 0 " + arguments);
    CHECK_MESSAGE(result.code == 2, arguments);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, arguments, ": ", result.out);
  };
  check_refused("--resize 3:0", "--resize: found 3:0; expected FRAME:N with N from 1 to 1024 CD nodes");
  check_refused("--resize 3:1025", "--resize: found 3:1025; expected FRAME:N");
  check_refused("--resize 3", "--resize: found 3; expected FRAME:N");
  check_refused("--resize 3:2,x", "--resize: found x; expected FRAME:N");
  check_refused("--resize 10:2", "--resize: found frame 10; expected 0 to 9, the counted frames");
  check_refused("--resize 3:2 --resize 4:1,3:3", "--resize: found frame 3 twice; expected each frame once");
  check_refused("--balance maybe", "--balance: found maybe; expected one of on, off");
  check_refused("--balance-by time", "--balance-by: found time; expected one of cpu, pairs");
}

TEST_CASE("an automatic placement is reported with the chosen one and does not change the digest") {
  const std::string arguments = "run --objects 300 --users 10 --frames 6 --warmup 2 --broad-phase auto --nodes ";
  const auto one_node = run_with_json(arguments + "1"), three_nodes = run_with_json(arguments + "3 --keep-resting off");
  CHECK(one_node["config"]["broad_phase"] == "server");
  CHECK(three_nodes["config"]["broad_phase"] == "region");
  CHECK(three_nodes["config"]["broad_phase_asked"] == "auto");
  CHECK(one_node["digest"] == three_nodes["digest"]);
  CHECK(test::ringfence(arguments + "3").out.find("broad phase: auto (region)") != std::string::npos);
}

TEST_CASE("replay accepts --resize within its number of frames and keeps its digest") {
  const std::string files = std::string("replay --nodes 1 --scene ") + RINGFENCE_DATA + "/air/scene.json --motion " +
                            RINGFENCE_DATA + "/air/motion.csv";
  const std::string digest = test::digest_in(test::ringfence(files).out);
  const ProgramResult resized = test::ringfence(files + " --resize 100:5,299:2");
  CHECK(test::digest_in(resized.out) == digest);
  CHECK(resized.out.find("resize      frame 100: 1 to 5 nodes") != std::string::npos);
  CHECK(test::ringfence(files + " --resize 300:2").out.find("expected 0 to 299") != std::string::npos);
}

}  // namespace ringfence
