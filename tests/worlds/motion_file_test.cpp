#include "worlds/motion_file.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "motion/random.hpp"
#include "worlds/error_message.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::worlds {
namespace {

using test::error_message_of;

const std::string header = "frame,object,x,y,z,qx,qy,qz,qw\n";
const std::string header_with_jump = "frame,object,x,y,z,qx,qy,qz,qw,jump\n";

/// Three objects: 7 and 9 may move, 8 is static, 9 is absent at the start.
Scene three_objects() {
  Scene scene;
  scene.shapes.push_back({"ball", Sphere{1}, {}});
  for (const ObjectNumber number : {7u, 8u, 9u}) {
    ObjectSpec object;
    object.number = number;
    object.category = number == 8 ? Category::fixed : Category::active;
    object.enabled = number != 9;
    object.pose.position = {static_cast<double>(number), 0, 0};
    scene.objects.push_back(object);
  }
  return scene;
}

std::string csv_error(const std::string& rows) {
  return error_message_of([&] { parse_motion(header + rows, "m.csv", three_objects()); });
}

constexpr double absent = std::numeric_limits<double>::quiet_NaN();

/// Binary motion of `three_objects`, two frames: 7 moves and 9 appears in frame 1.
std::string binary_motion() {
  const auto file = std::filesystem::temp_directory_path() / "ringfence_motion_test.bin";
  BinaryMotionWriter writer(file, 3);
  const Pose seven{{7, 0, 0}, {}}, eight{{8, 0, 0}, {}}, none{{absent, absent, absent}, {}};
  writer.add_frame(std::vector<Pose>{seven, eight, none});
  writer.add_frame(std::vector<Pose>{{{7, 1, 0}, {}}, eight, {{9, 9, 9}, {0, 1, 0, 0}}});
  writer.finish();
  std::string bytes = read_text(file);
  std::filesystem::remove(file);
  return bytes;
}

template <class T>
std::string with(std::string bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

std::string binary_error(const std::string& bytes) {
  return error_message_of([&] { parse_motion(bytes, "m.bin", three_objects()); });
}

}  // namespace

TEST_CASE("a CSV row sets a pose, and a row without a pose makes the object absent") {
  const Motion motion =
      parse_motion(header + "0,7,1,2,3,0,0,0,1\r\n2,7,,,,,,,\n2,9,-0.5,1e3,2,1,0,0,0", "m", three_objects());
  CHECK(motion.frames == 3);
  REQUIRE(motion.rows.size() == 3);
  CHECK(motion.rows[0] == MotionRow{0, 7, true, false, {{1, 2, 3}, {}}});
  CHECK(motion.rows[1] == MotionRow{2, 7, false, false, {}});
  CHECK(motion.rows[2] == MotionRow{2, 9, true, false, {{-0.5, 1000, 2}, {1, 0, 0, 0}}});
  CHECK(parse_motion(header, "m", three_objects()).frames == 0);
}

TEST_CASE("motion written as CSV reads back with the same bits, with jumps and without") {
  const std::uint64_t seed = 17;
  CAPTURE(seed);
  const bool both[] = {false, true};
  for (const bool jumps : both) {
    CAPTURE(jumps);
    Motion motion;
    motion.frames = 2000;
    motion::Draws draws(seed, 1, 1);
    for (std::uint32_t frame = 0; frame < 2000; ++frame) {
      const auto wide = [&] {
        for (;;) {
          const auto value = std::bit_cast<double>(std::uint64_t{draws.word()} << 32 | draws.word());
          if (std::isfinite(value)) return value;
        }
      };
      const double x = wide(), y = wide(), z = wide();
      Quat q{draws.unit(), draws.unit(), draws.unit(), draws.unit() + 0.1f};
      const float inverse = 1 / std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
      q = {q.x * inverse, q.y * inverse, q.z * inverse, q.w * inverse};
      motion.rows.push_back({frame, frame % 2 == 0 ? 7u : 9u, frame % 7 != 0, jumps && frame % 5 == 0, {}});
      if (motion.rows.back().present) motion.rows.back().pose = {{x, y, z}, q};
    }
    const Motion again = parse_motion(format_motion_csv(motion), "m", three_objects());
    CHECK(again.frames == motion.frames);
    REQUIRE(again.rows.size() == motion.rows.size());
    for (std::size_t i = 0; i < again.rows.size(); ++i) REQUIRE(again.rows[i] == motion.rows[i]);
  }
}

TEST_CASE("the last column of a CSV file may say which rows are jumps") {
  const Motion motion =
      parse_motion(header_with_jump + "0,7,1,2,3,0,0,0,1,0\r\n1,7,4,5,6,0,0,0,1,1\n2,7,,,,,,,,0\n3,7,1,2,3,0,0,0,1,1",
                   "m", three_objects());
  REQUIRE(motion.rows.size() == 4);
  CHECK(motion.rows[0] == MotionRow{0, 7, true, false, {{1, 2, 3}, {}}});
  CHECK(motion.rows[1] == MotionRow{1, 7, true, true, {{4, 5, 6}, {}}});
  CHECK(motion.rows[2] == MotionRow{2, 7, false, false, {}});
  CHECK(motion.rows[3].jump);
}

TEST_CASE("the column jump is written only where a row is a jump") {
  Motion motion;
  motion.frames = 2;
  motion.rows = {{0, 7, true, false, {}}, {1, 7, false, false, {}}};
  CHECK(format_motion_csv(motion) == header + "0,7,0,0,0,0,0,0,1\n1,7,,,,,,,\n");
  motion.rows[0].jump = true;
  CHECK(format_motion_csv(motion) == header_with_jump + "0,7,0,0,0,0,0,0,1,1\n1,7,,,,,,,,0\n");
}

TEST_CASE("each error in the column jump is reported with line, field, found value and expectation") {
  struct Case {
    const char *rows, *message;
  };
  const Case cases[] = {
      {"0,7,1,2,3,0,0,0,1\n", "m.csv:2: found 9 fields; expected 10: frame,object,x,y,z,qx,qy,qz,qw,jump"},
      {"0,7,1,2,3,0,0,0,1,0,\n", "m.csv:2: found 11 fields; expected 10: frame,object,x,y,z,qx,qy,qz,qw,jump"},
      {"0,7,1,2,3,0,0,0,1,\n", "m.csv:2: jump: found \"\"; expected 0 or 1"},
      {"0,7,1,2,3,0,0,0,1,0\n1,7,1,2,3,0,0,0,1,2\n", "m.csv:3: jump: found \"2\"; expected 0 or 1"},
      {"0,7,1,2,3,0,0,0,1,true\n", "m.csv:2: jump: found \"true\"; expected 0 or 1"},
      {"0,7,1,2,3,0,0,0,1, 1\n", "m.csv:2: jump: found \" 1\"; expected 0 or 1"},
      {"0,7,,,,,,,,x\n", "m.csv:2: jump: found \"x\"; expected 0 or 1"},
  };
  for (const Case& each : cases) {
    const std::string text = header_with_jump + each.rows;
    CHECK(error_message_of([&] { parse_motion(text, "m.csv", three_objects()); }) == each.message);
  }
}

TEST_CASE("each error in CSV motion is reported with line, field, found value and expectation") {
  const std::string csv_header_message =
      "expected the header \"frame,object,x,y,z,qx,qy,qz,qw\", with or without \",jump\" at the end";
  CHECK(error_message_of([] { parse_motion("", "m.csv", three_objects()); }) ==
        "m.csv:0: found \"\"; " + csv_header_message);
  CHECK(error_message_of([] { parse_motion("frame,object\n", "m.csv", three_objects()); }) ==
        "m.csv:1: found \"frame,object\"; " + csv_header_message);
  struct Case {
    const char *rows, *message;
  };
  const Case cases[] = {
      {"0,7,1,2,3,0,0,1\n", "m.csv:2: found 8 fields; expected 9: frame,object,x,y,z,qx,qy,qz,qw"},
      {"0,7,1,2,3,0,0,0,1,\n", "m.csv:2: found 10 fields; expected 9: frame,object,x,y,z,qx,qy,qz,qw"},
      {"\n", "m.csv:2: found 1 fields; expected 9: frame,object,x,y,z,qx,qy,qz,qw"},
      {"-1,7,1,2,3,0,0,0,1\n", "m.csv:2: frame: found \"-1\"; expected a whole number of 0 or more"},
      {"5,7,1,2,3,0,0,0,1\n4,9,1,2,3,0,0,0,1\n", "m.csv:3: frame: found 4 after 5; expected frames in ascending order"},
      {"400000000,7,1,2,3,0,0,0,1\n", "m.csv:2: frame: found 400000000; expected less than 100000000"},
      {"0,5,1,2,3,0,0,0,1\n", "m.csv:2: object: found 5; expected an id of the scene"},
      {"0,x,1,2,3,0,0,0,1\n", "m.csv:2: object: found \"x\"; expected the id of an object"},
      {"0,8,1,2,3,0,0,0,1\n", "m.csv:2: object: 8 is static; expected rows only of objects that may move"},
      {"3,7,1,2,3,0,0,0,1\n3,7,1,2,3,0,0,0,1\n",
       "m.csv:3: object: 7 has two rows in frame 3; expected at most one row per frame"},
      {"0,7,1,nan,3,0,0,0,1\n", "m.csv:2: y: found \"nan\"; expected a finite number"},
      {"0,7,1,2,inf,0,0,0,1\n", "m.csv:2: z: found \"inf\"; expected a finite number"},
      {"0,7,1,2,1e999,0,0,0,1\n", "m.csv:2: z: found \"1e999\"; expected a finite number"},
      {"0,7,1,2,3m,0,0,0,1\n", "m.csv:2: z: found \"3m\"; expected a finite number"},
      {"0,7,,2,3,0,0,0,1\n", "m.csv:2: x: found \"\"; expected a finite number"},
      {"0,7,1,2,3,0,0,0,0\n",
       "m.csv:2: qx,qy,qz,qw: found (0, 0, 0, 0); expected a unit quaternion (length 1 within 0.001)"},
      {"0,7,1,2,3,0,0,0,1.01\n",
       "m.csv:2: qx,qy,qz,qw: found (0, 0, 0, 1.01); expected a unit quaternion (length 1 within 0.001)"},
  };
  for (const Case& each : cases) CHECK(csv_error(each.rows) == each.message);
}

TEST_CASE("binary motion is read as one row per change") {
  const Motion motion = parse_motion(binary_motion(), "m.bin", three_objects());
  CHECK(motion.frames == 2);
  REQUIRE(motion.rows.size() == 2);
  CHECK(motion.rows[0] == MotionRow{1, 7, true, false, {{7, 1, 0}, {}}});
  CHECK(motion.rows[1] == MotionRow{1, 9, true, false, {{9, 9, 9}, {0, 1, 0, 0}}});
}

TEST_CASE("each error in binary motion is reported with byte offset, found value and expectation") {
  const std::string good = binary_motion();
  REQUIRE(good.size() == 24 + 2 * 3 * 40);
  CHECK(binary_error(good).empty());
  CHECK(binary_error(good.substr(0, 20)) == "m.bin: byte 20: the file ends within the header; expected 24 bytes");
  CHECK(binary_error(good.substr(0, 263)) == "m.bin: byte 263: the file ends within frame 1 of 2; expected 264 bytes");
  CHECK(binary_error(good + "x") == "m.bin: byte 264: 1 bytes follow the last of 2 frames; expected the end");
  CHECK(binary_error(with(good, 8, 2u)) == "m.bin: byte 8: version: found 2; expected 1");
  CHECK(binary_error(with(good, 12, 4u)) == "m.bin: byte 12: objects: found 4; expected 3, as in the scene");
  CHECK(binary_error(with(good, 16, 0xffffffffu)) ==
        "m.bin: byte 16: frames: found 4294967295; expected less than 100000000");
  CHECK(binary_error(with(good, 16, 3u)) == "m.bin: byte 264: the file ends within frame 2 of 3; expected 384 bytes");
  CHECK(binary_error(with(good, 20, 1u)) == "m.bin: byte 20: found 1; expected 0");
  CHECK(binary_error(with(good, 24 + 120, std::numeric_limits<double>::infinity())) ==
        "m.bin: byte 144: frame 1, object 7: position: found (inf, 1, 0); expected finite numbers, or NaN for absent");
  CHECK(binary_error(with(good, 24 + 120 + 36, 0.5f)) ==
        "m.bin: byte 168: frame 1, object 7: orientation: found (0, 0, 0, 0.5); expected a unit quaternion (length 1 "
        "within 0.001)");
  CHECK(binary_error(with(good, 24 + 120 + 36, std::numeric_limits<float>::quiet_NaN())).find("orientation") !=
        std::string::npos);
  CHECK(binary_error(with(good, 24 + 160, 3.0)) ==
        "m.bin: byte 184: frame 1, object 8: is static but moves; expected its pose in the scene");
}

TEST_CASE("the error message names a file that cannot be read or written") {
  CHECK(error_message_of([] { read_motion("/nowhere/m.csv", three_objects()); }) ==
        "/nowhere/m.csv: cannot be opened: No such file or directory");
  CHECK_THROWS_WITH_AS(BinaryMotionWriter("/nowhere/m.bin", 3),
                       "/nowhere/m.bin: cannot be written: No such file or directory", Error);
}

}  // namespace ringfence::worlds
