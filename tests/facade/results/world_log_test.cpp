#include "facade/results/world_log.hpp"

#include <new>
#include <string>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

struct Fixture {
  std::vector<std::string> lines;
  const LogHook hook = [this](LogLevel level, std::string_view line) {
    lines.push_back(std::string(name_of(level)) + ": " + std::string(line));
  };
  WorldLog log{hook};
  bool has(std::size_t line, const char* text) const { return lines.at(line).find(text) != std::string::npos; }
};

TEST_CASE("nothing is logged without a hook") {
  const LogHook none;
  WorldLog log(none);
  log.write(LogLevel::error, "line");
  log.log_halt(1);
}

TEST_CASE("only the first frame that outgrew what was reserved is logged") {
  Fixture fixture;
  FrameReport report;
  fixture.log.log_growth(report);
  CHECK(fixture.lines.empty());
  report.grown = 1;
  report.frame = 4;
  fixture.log.log_growth(report);
  report.frame = 5;
  fixture.log.log_growth(report);
  REQUIRE(fixture.lines.size() == 1);
  CHECK(fixture.has(0, "warning: frame 4 outgrew"));
}

TEST_CASE("the first 100 failures of the motion model are logged") {
  Fixture fixture;
  FrameReport report;
  report.model_failures.resize(16, {ObjectId::of(3, 1), "no path"});
  for (report.frame = 0; report.frame < 10; ++report.frame) fixture.log.log_model_failures(report);
  REQUIRE(fixture.lines.size() == 100);
  CHECK(fixture.has(0, "frame 0: the motion model threw for object 3: no path"));
  CHECK(!fixture.has(98, "further failures are not logged"));
  CHECK(fixture.has(99, "further failures are not logged"));
}

TEST_CASE("failures of support functions are logged with their reasons, those of remote nodes once") {
  Fixture fixture;
  FrameReport report;
  const std::vector<std::string> failures{"shape 1 threw", "shape 2 threw"};
  fixture.log.log_support_failures(failures, report, false);
  CHECK(fixture.lines.size() == 2);
  report.failed_supports = 7;
  fixture.log.log_support_failures({}, report, false);
  CHECK(fixture.lines.size() == 2);
  fixture.log.log_support_failures({}, report, true);
  fixture.log.log_support_failures({}, report, true);
  REQUIRE(fixture.lines.size() == 3);
  CHECK(fixture.has(2, "7 pairs have no contact"));
}

TEST_CASE("each lost node and each late user is logged") {
  Fixture fixture;
  FrameReport report;
  fixture.log.log_losses(report, 3, false);
  CHECK(fixture.lines.empty());
  report.lost = {NodeId(2), NodeId(5)};
  report.late = {UserId(9)};
  fixture.log.log_losses(report, 3, true);
  REQUIRE(fixture.lines.size() == 4);
  CHECK(fixture.has(0, "all CD nodes are lost"));
  CHECK(fixture.has(1, "error: CD node 2 stopped answering"));
  CHECK(fixture.has(2, "3 left"));
  CHECK(fixture.has(3, "warning: user node 9 missed its deadline"));
}

TEST_CASE("the end of memory is logged once, and a hook that throws does no harm") {
  Fixture fixture;
  fixture.log.log_halt(12);
  fixture.log.log_halt(13);
  REQUIRE(fixture.lines.size() == 1);
  CHECK(fixture.has(0, "error: memory ran out in frame 12"));
  const LogHook throws = [](LogLevel, std::string_view) { throw std::bad_alloc(); };
  WorldLog(throws).log_halt(1);
}

}  // namespace
}  // namespace ringfence::facade
