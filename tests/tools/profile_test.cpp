#include "profile.hpp"

#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

KindReport timed_kind(ShapeKind first, std::uint64_t candidates, std::uint64_t nanoseconds) {
  KindReport kind;
  kind.first = kind.second = first;
  kind.candidates = candidates;
  kind.timed = 100;
  kind.nanoseconds = nanoseconds;
  return kind;
}

}  // namespace

TEST_CASE("percentiles of the cost lie in the bucket that contains their rank") {
  KindReport kind = timed_kind(ShapeKind::box, 1000, 2400);
  kind.cost[8] = 60;   // 16 to 22.6 ns
  kind.cost[10] = 39;  // 32 to 45.3 ns
  kind.cost[16] = 1;   // 256 to 362 ns
  const tools::CandidateCost cost = tools::candidate_cost(kind);
  CHECK(cost.p50 >= 16);
  CHECK(cost.p50 <= 22.7);
  CHECK(cost.p90 >= 32);
  CHECK(cost.p90 <= 45.3);
  CHECK(cost.p99 <= 45.3);
  kind.cost[16] = 2;
  kind.cost[10] = 38;
  CHECK(tools::candidate_cost(kind).p99 >= 256);
  CHECK(tools::candidate_cost({}).p50 == 0);
}

TEST_CASE("the mean cost is exact and excludes samples of a preempted thread") {
  KindReport kind = timed_kind(ShapeKind::box, 1000, 2400);
  kind.cost[8] = 99;  // 16 to 22.6 ns
  kind.cost[16] = 1;  // 256 to 362 ns: a long search
  CHECK(tools::candidate_cost(kind).mean == 24);
  kind.cost[16] = 0;
  kind.cost[34] = 1;  // from 131 us
  kind.nanoseconds += 150'000;
  CHECK(tools::candidate_cost(kind).mean == doctest::Approx(19).epsilon(0.05));
}

TEST_CASE("pairs of kinds are sorted by their total time, not by the cost of one candidate") {
  FrameReport report;
  report.kinds = {timed_kind(ShapeKind::sphere, 100000, 500), timed_kind(ShapeKind::box, 100, 9000)};
  tools::Figures figures;
  figures.add(report, {});
  const auto kinds = tools::by_cost(figures);
  REQUIRE(kinds.size() == 2);
  CHECK(kinds[0].first == ShapeKind::sphere);
}

TEST_CASE("the profile of a run has all its candidates, shares with the sum 1, and the digest of the run") {
  const TemporaryFolder folder;
  const std::string json = folder / "p.json", trace = folder / "t.json";
  const std::string world = "--objects 1500 --users 10 --frames 8 --warmup 2 --nodes 2 ";
  const ProgramResult result = test::ringfence("profile " + world + "--json " + json + " --trace " + trace);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  for (const char* word : {"ns mean", "p99", "lanes", "early", "gather", "imbalance", "box-box"}) {
    CHECK_MESSAGE(result.out.find(word) != std::string::npos, word);
  }
  CHECK(test::digest_in(result.out) == test::digest_in(test::ringfence("run " + world).out));
  const auto report = nlohmann::json::parse(worlds::read_text(json));
  double candidates = 0, shares = 0;
  for (const auto& kind : report["profile"]["kinds"]) {
    candidates += kind["candidates"].get<double>();
    shares += kind["share"].get<double>();
    const auto& ns = kind["ns_per_candidate"];
    CHECK(ns["p50"] <= ns["p90"]);
    CHECK(ns["p90"] <= ns["p99"]);
    CHECK(kind["lane_use"] <= 1);
    CHECK(kind["hit_share"] <= 1);
    CHECK(kind["gather_share"] <= 1);
  }
  CHECK(candidates * 8 == doctest::Approx(report["pairs"]["tested"].get<double>()));
  CHECK(shares == doctest::Approx(1));
  CHECK(report["profile"]["imbalance"] >= 1);
  CHECK(nlohmann::json::parse(worlds::read_text(trace))["traceEvents"].size() > 8);
}

TEST_CASE("profile accepts a scene with the options and the digest of replay") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "w";
  REQUIRE(test::ringfence("record --objects 200 --users 10 --frames 6 --out " + prefix).code == 0);
  const std::string files = " --scene " + prefix + ".json --motion " + prefix + ".bin";
  const ProgramResult profile = test::ringfence("profile" + files);
  CHECK_MESSAGE(profile.code == 0, profile.out);
  CHECK(profile.out.find("6 frames counted after 0 of warm-up") != std::string::npos);
  CHECK(test::digest_in(profile.out) == test::digest_in(test::ringfence("replay" + files).out));

  CHECK(test::ringfence("profile --scene " + prefix + ".json").code == 2);
  const ProgramResult none = test::ringfence("profile --frames 0");
  CHECK(none.code == 2);
  CHECK(none.out.find("--frames: found 0; expected 1 to 10000000") != std::string::npos);
}

}  // namespace ringfence
