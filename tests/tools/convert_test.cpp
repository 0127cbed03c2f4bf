#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include "tools/program.hpp"
#include "trace.hpp"
#include "worlds/error_message.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

std::string sample(int second, const char* aircraft, double latitude, double longitude, double feet) {
  return "{\"timestamp\":" + std::to_string(1533099600000 + second * 1000) + ",\"icao24\":\"" + aircraft +
         "\",\"latitude\":" + std::to_string(latitude) + ",\"longitude\":" + std::to_string(longitude) +
         ",\"altitude\":" + std::to_string(feet) + "}";
}

double distance(const Vec3d& p, const Vec3d& q) { return std::hypot(p.x - q.x, p.y - q.y); }

}  // namespace

TEST_CASE("the projection of air traffic keeps distances within 0.2 % and altitudes exactly") {
  const std::string text = "[" + sample(0, "a", 46, 6, 35000) + "," + sample(0, "b", 47.5, 10, 36000) + "," +
                           sample(10, "a", 46.25, 6, 35000) + "," + sample(10, "b", 47.5, 10.25, 36000) + "]";
  const Trace trace = read_air(text, "a.json", "", 0);
  const auto &a = trace.tracks.at("a"), &b = trace.tracks.at("b");
  REQUIRE(a.size() == 2);
  CHECK(a[1].frame == 1);
  const double degree = 6'371'008.8 * 3.14159265358979 / 180;
  CHECK(distance(a[0].position, a[1].position) == doctest::Approx(degree / 4).epsilon(0.002));
  CHECK(distance(b[0].position, b[1].position) ==
        doctest::Approx(degree / 4 * std::cos(47.5 * 3.14159265358979 / 180)).epsilon(0.002));
  CHECK(a[0].position.z == 35000 * 0.3048);
  CHECK(b[0].position.x > a[0].position.x);  // x is east
  CHECK(a[1].position.y > a[0].position.y);  // y is north
}

TEST_CASE("a short gap is interpolated linearly, and in a long gap the object is absent") {
  Trace trace;
  trace.shape = {"ball", Sphere{1}, {}};
  trace.longest_gap = 3;
  trace.tracks["a"] = {{2, {0, 0, 0}}, {5, {3, 0, 0}}, {9, {4, 0, 0}}};
  trace.tracks["b"] = {{0, {0, 5, 0}}, {1, {0, 6, 0}}, {12, {0, 7, 0}}};
  const TraceWorld world = make_trace_world(trace, 1);
  CHECK(world.motion.frames == 13);
  std::string a;
  for (const worlds::MotionRow& row : world.motion.rows) {
    if (row.object == 1)
      a += std::to_string(row.frame) + (row.present ? "@" + std::to_string(std::lround(row.pose.position.x)) : "-") +
           " ";
  }
  CHECK(a == "2@0 3@1 4@2 5@3 6- 9@4 10- ");
  for (const ObjectSpec& object : world.scene.objects) CHECK(!object.enabled);
}

TEST_CASE("copies of a trace lie side by side with increasing delays and unchanged distances") {
  Trace trace;
  trace.shape = {"ball", Sphere{1}, {}};
  trace.tracks["a"] = {{0, {0, 0, 0}}};
  trace.tracks["b"] = {{0, {3, 4, 0}}};
  const TraceWorld world = make_trace_world(trace, 3);
  REQUIRE(world.scene.objects.size() == 6);
  const auto& rows = world.motion.rows;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    if (rows[i].present && rows[i + 1].present && rows[i].frame == rows[i + 1].frame) {
      CHECK(distance(rows[i].pose.position, rows[i + 1].pose.position) == doctest::Approx(5));
    }
  }
  CHECK(world.motion.frames == 15);
}

TEST_CASE("an invalid trace is refused with line, found value and expectation") {
  using test::error_message_of;
  CHECK(error_message_of([] { read_crowd("1 2 3.0 4.0\n", "c.txt"); }) ==
        "c.txt:1: expected five numbers: id frame x/cm y/cm z/cm");
  CHECK(error_message_of([] { read_crowd("# no\n1 5 3 4 5\n1 5 3 4 5\n", "c.txt"); }) ==
        "c.txt:3: frame: found 5 after 5 of person 1; expected ascending order");
  CHECK(error_message_of([] { read_crowd("", "c.txt"); }) == "c.txt: expected at least one line of numbers");
  CHECK(error_message_of([] { read_air("[{\"timestamp\": 5}]", "a.json", "", 0); }) ==
        "a.json:1: [0]: the field \"latitude\" is missing");
  CHECK(error_message_of([] {
          read_air("[" + sample(0, "a", 99, 6, 1) + "]", "a.json", "", 0);
        }).find("degrees between") != std::string::npos);
}

TEST_CASE("for a compressed trace the error message contains the command that decompresses it") {
  const test::TemporaryFolder folder;
  worlds::write_text(folder / "a.gz", "\x1f\x8b rest");
  const test::ProgramResult result = test::ringfence("convert air " + (folder / "a.gz") + " --out " + (folder / "x"));
  CHECK(result.code == 2);
  CHECK(result.out.find("zcat " + (folder / "a.gz") + " | ringfence convert air - --out") != std::string::npos);
}

TEST_CASE("a converted trace can be replayed") {
  const test::TemporaryFolder folder;
  worlds::write_text(folder / "c.txt", "1 94 0 0 176\n2 94 50 0 176\n1 95 10 0 176\n2 95 45 0 176\n1 96 20 0 176\n");
  const std::string prefix = folder / "crowd";
  CHECK(test::ringfence("convert crowd " + (folder / "c.txt") + " --copies 2 --out " + prefix).code == 0);
  const test::ProgramResult result =
      test::ringfence("replay --check --nodes 1 --scene " + prefix + ".json --motion " + prefix + ".csv");
  CHECK_MESSAGE(result.code == 0, result.out);
}

}  // namespace ringfence::tools
