// Query files: what they say, and what is refused.
#include "worlds/query_file.hpp"

#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "worlds/error_message.hpp"

namespace ringfence::worlds {
namespace {

const std::string header = "frame,query,kind,shape,x,y,z,qx,qy,qz,qw,dx,dy,dz,layers,except,at\n";

/// A ball and a mesh, two layers, and the objects 7 and 9.
Scene small_scene() {
  Scene scene;
  scene.layers.names = {"players", "walls"};
  scene.shapes.push_back({"ball", Sphere{1}, {}});
  scene.shapes.push_back({"rock", TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}}, "rock.ply"});
  for (const ObjectNumber number : {7u, 9u}) {
    ObjectSpec object;
    object.number = number;
    scene.objects.push_back(object);
  }
  return scene;
}

std::vector<QueryRow> parse(const std::string& rows) { return parse_queries(header + rows, "q.csv", small_scene(), 5); }

std::string error_of(const std::string& rows) {
  return test::error_message_of([&] { parse(rows); });
}

void check_error(const std::string& rows, const std::string& expected) {
  CHECK_MESSAGE(error_of(rows) == expected, rows);
}

}  // namespace

TEST_CASE("a query file has a row for each query of each kind") {
  const std::vector<QueryRow> rows = parse(
      "0,1,ray,,1,2,3,,,,,4,5,6,,,\r\n"
      "0,2,ray_any,,1,2,3,0,0,0,1,4,5,6,walls,7,0\n"
      "0,3,ray_all,,1,2,3,0,0,1,0,4,5,6,players+walls,,\n"
      "2,1,sweep,ball,1,2,3,0,0,1,0,4,5,6,,9,2.0\n"
      "2,2,sweep_all,ball,1,2,3,,,,,0,0,0,players,,\n"
      "2,3,overlap,ball,1e15,-2,0.1,1,0,0,0,,,,,,\n"
      "2,4,overlap,ball,1,2,3,,,,,0,-0,0,,,\n"
      "4,4294967295,nearest,,1,2,3,,,,,2.5,,,,,");
  REQUIRE(rows.size() == 8);
  using enum QueryKind;
  const Pose place{{1, 2, 3}, {}};
  const Vec3d path{4, 5, 6};
  CHECK(rows[0] == QueryRow{0, 1, ray, 0, place, path});
  CHECK(rows[1] == QueryRow{0, 2, ray_any, 0, place, path, 0, 2, 7});
  CHECK(rows[2] == QueryRow{0, 3, ray_all, 0, place, path, 0, 3});  // a ray is not turned
  CHECK(rows[3] == QueryRow{2, 1, sweep, 0, {{1, 2, 3}, {0, 0, 1, 0}}, path, 0, 0xffffffffu, 9});
  CHECK(rows[4] == QueryRow{2, 2, sweep_all, 0, place, {}, 0, 1});
  CHECK(rows[5] == QueryRow{2, 3, overlap, 0, {{1e15, -2, 0.1}, {1, 0, 0, 0}}});
  CHECK(rows[6] == QueryRow{2, 4, overlap, 0, place});
  CHECK(rows[7] == QueryRow{4, 4294967295u, nearest, 0, place, {}, 2.5});
  CHECK(parse("").empty());
}

TEST_CASE("the queries of a frame are returned in order of their ids") {
  const std::vector<QueryRow> rows = parse(
      "0,9,ray,,0,0,0,,,,,1,0,0,,,\n0,3,ray,,0,0,0,,,,,1,0,0,,,\n1,5,ray,,0,0,0,,,,,1,0,0,,,\n"
      "1,3,ray,,0,0,0,,,,,1,0,0,,,\n");
  REQUIRE(rows.size() == 4);
  CHECK((rows[0].query == 3 && rows[1].query == 9 && rows[2].query == 3 && rows[3].query == 5));
}

TEST_CASE("wrong columns of a query file are refused with the line") {
  CHECK(test::error_message_of([] { parse_queries("frame,query\n", "q.csv", small_scene(), 5); }) ==
        "q.csv:1: found \"frame,query\"; expected the header \"" + header.substr(0, header.size() - 1) + "\"");
  CHECK(test::error_message_of([] {
          parse_queries("", "q.csv", small_scene(), 5);
        }).starts_with("q.csv:0: found \"\"; expected the header"));
  CHECK(error_of("0,1,ray,,0,0,0,,,,,1,0,0,,\n").starts_with("q.csv:2: found 16 fields; expected 17: frame,query,"));
  CHECK(error_of("0,1,ray,,0,0,0,,,,,1,0,0,,,\n\n").starts_with("q.csv:3: found 1 fields; expected 17: "));
}

TEST_CASE("frames, ids and kinds of queries are checked") {
  const std::string rest = ",ray,,0,0,0,,,,,1,0,0,,,\n";
  check_error("5,1" + rest, "q.csv:2: frame: found 5; expected less than 5, the number of counted frames");
  check_error("-1,1" + rest, "q.csv:2: frame: found \"-1\"; expected a whole number of 0 or more");
  check_error("3,1" + rest + "2,1" + rest, "q.csv:3: frame: found 2 after 3; expected frames in ascending order");
  check_error("3,x" + rest, "q.csv:2: query: found \"x\"; expected a whole number of 0 or more");
  check_error("3,1" + rest + "3,2" + rest + "3,1" + rest,
              "q.csv:4: query: found 1 twice in frame 3; expected distinct ids in each frame");
  CHECK(error_of("3,1" + rest + "4,1" + rest).empty());
  check_error("0,1,shot,,0,0,0,,,,,1,0,0,,,\n",
              "q.csv:2: kind: found \"shot\"; expected one of ray, ray_any, ray_all, sweep, sweep_all, overlap, "
              "nearest");
}

TEST_CASE("shapes, layers and objects of queries are those of the scene") {
  check_error("0,1,sweep,bal,0,0,0,,,,,1,0,0,,,\n",
              "q.csv:2: shape: found \"bal\"; expected the name of a shape of the scene");
  check_error("0,1,overlap,,0,0,0,,,,,,,,,,\n",
              "q.csv:2: shape: found \"\"; expected the name of a shape of the scene");
  check_error("0,1,overlap,rock,0,0,0,,,,,,,,,,\n",
              "q.csv:2: shape: \"rock\" is a mesh; expected a convex shape: a sphere, box, capsule or convex hull");
  check_error("0,1,ray,ball,0,0,0,,,,,1,0,0,,,\n",
              "q.csv:2: shape: found \"ball\"; expected nothing, as ray has no shape");
  check_error("0,1,ray,,0,0,0,,,,,1,0,0,players+floors,,\n",
              "q.csv:2: layers: found \"floors\"; expected layers of the scene, joined by +: players, walls");
  check_error("0,1,ray,,0,0,0,,,,,1,0,0,players+,,\n",
              "q.csv:2: layers: found \"\"; expected layers of the scene, joined by +: players, walls");
  Scene without_layers = small_scene();
  without_layers.layers.names.clear();
  CHECK(test::error_message_of([&] {
          parse_queries(header + "0,1,ray,,0,0,0,,,,,1,0,0,a,,\n", "q.csv", without_layers, 5);
        }) == "q.csv:2: layers: found \"a\"; expected nothing, as the scene has no layers");
  check_error("0,1,ray,,0,0,0,,,,,1,0,0,,8,\n",
              "q.csv:2: except: found \"8\"; expected the id of an object of the scene, or nothing");
  check_error("0,1,ray,,0,0,0,,,,,1,0,0,,x,\n",
              "q.csv:2: except: found \"x\"; expected the id of an object of the scene, or nothing");
}

TEST_CASE("numbers of queries are finite, and orientations are of unit length") {
  check_error("0,1,ray,,0,nan,0,,,,,1,0,0,,,\n", "q.csv:2: y: found \"nan\"; expected a finite number");
  check_error("0,1,ray,,0,,0,,,,,1,0,0,,,\n", "q.csv:2: y: found \"\"; expected a finite number");
  check_error("0,1,ray,,0,0,0,,,,,inf,0,0,,,\n", "q.csv:2: dx: found \"inf\"; expected a finite number");
  check_error("0,1,ray,,0,0,2e15,,,,,1,0,0,,,\n", "q.csv:2: z: found \"2e15\"; expected at most 10^15 metres");
  check_error("0,1,ray,,0,0,0,,,,,1,,0,,,\n", "q.csv:2: dy: found \"\"; expected a finite number");
  check_error("0,1,sweep,ball,0,0,0,0,0,0,0,1,0,0,,,\n",
              "q.csv:2: qx,qy,qz,qw: found (0, 0, 0, 0); expected a unit quaternion (length 1 within 0.001)");
  check_error("0,1,sweep,ball,0,0,0,0,0,,1,1,0,0,,,\n", "q.csv:2: qz: found \"\"; expected a finite number");
  check_error("0,1,nearest,,0,0,0,,,,,-1,,,,,\n", "q.csv:2: dx: found \"-1\"; expected a distance of 0 or more");
  check_error("0,1,nearest,,0,0,0,,,,,,,,,,\n", "q.csv:2: dx: found \"\"; expected a finite number");
  check_error("0,1,nearest,,0,0,0,,,,,1,2,,,,\n",
              "q.csv:2: dy: found \"2\"; expected nothing or 0, as nearest does not use it");
  check_error("0,1,overlap,ball,0,0,0,,,,,3,,,,,\n",
              "q.csv:2: dx: found \"3\"; expected nothing or 0, as overlap does not use it");
}

TEST_CASE("a query asks about the frame of its row only, and another is refused with the range") {
  check_error("3,1,ray,,0,0,0,,,,,1,0,0,,,2\n",
              "q.csv:2: at: found \"2\"; expected a frame from 3 to 3, or nothing for this one; --history has 0");
  check_error("3,1,ray,,0,0,0,,,,,1,0,0,,,2.5\n",
              "q.csv:2: at: found \"2.5\"; expected a frame from 3 to 3, or nothing for this one; --history has 0");
  check_error("3,1,ray,,0,0,0,,,,,1,0,0,,,now\n", "q.csv:2: at: found \"now\"; expected a finite number");
}

TEST_CASE("with a history a query asks about a frame in it, or between two") {
  const auto at = [](const std::string& text, std::uint32_t history) {
    return parse_queries(header + "3,1,ray,,0,0,0,,,,,1,0,0,,," + text + "\n", "q.csv", small_scene(), 5, history)
        .at(0)
        .at;
  };
  CHECK(at("", 2) == std::nullopt);
  CHECK(at("1", 2) == 1);
  CHECK(at("2.75", 2) == 2.75);
  CHECK(at("3", 2) == std::nullopt);
  CHECK(at("0", 100) == 0);
  for (const char* text : {"0.999", "3.001", "-1"}) {
    CHECK(test::error_message_of([&] { at(text, 2); }) ==
          std::string("q.csv:2: at: found \"") + text +
              "\"; expected a frame from 1 to 3, or nothing for this one; --history has 2");
  }
}

}  // namespace ringfence::worlds
