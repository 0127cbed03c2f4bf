// Names that users have in scripts and files keep their meaning when names in the code change.
#include "frozen_names.hpp"

#include <set>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {

TEST_CASE("each stage is found by its word, and the last also by its frozen name") {
  for (std::size_t i = 0; i < node_stage_count; ++i) {
    const auto stage = static_cast<NodeStage>(i);
    CHECK(tools::find_stage(tools::word_of(stage)) == stage);
    CHECK(tools::list_stage_words().find(tools::word_of(stage)) != std::string::npos);
  }
  CHECK(tools::find_stage("telling") == NodeStage::reporting);
  CHECK_FALSE(tools::find_stage("dreaming"));
}

TEST_CASE("the program accepts the current and the frozen word of a stage") {
  for (const char* word : {"reporting", "telling"}) {
    const test::ProgramResult result =
        test::ringfence(std::string("run --objects 100 --users 2 --frames 4 --warmup 0 --nodes 2 "
                                    "--node-deadline-ms 100 --quiet --fail 2:1:") +
                        word);
    CHECK_MESSAGE(result.code == 0, result.out);
    CHECK(result.out.find("lost        frame 2: CD node 1") != std::string::npos);
  }
}

TEST_CASE("path_ms has the keys of version 0.1") {
  const std::set<std::string> expected{
      "open",        "invite",    "ingest", "node_move",   "user_move",    "dispatch",    "node_publish", "publish",
      "node_detect", "user_look", "draw",   "hear",        "collect",      "notify",      "inform",       "node_end",
      "user_end",    "heed",      "finish", "nodes_moved", "nodes_tested", "nodes_ended", "critical"};
  const test::TemporaryFolder folder;
  const std::string json = folder / "report.json";
  REQUIRE(test::ringfence("run --objects 100 --users 2 --frames 2 --warmup 0 --nodes 1 --quiet --json " + json).code ==
          0);
  std::set<std::string> keys;
  const auto report = nlohmann::json::parse(worlds::read_text(json));
  for (const auto& [key, value] : report["path_ms"].items()) keys.insert(key);
  CHECK(keys == expected);
}

}  // namespace ringfence
