#include "worlds/scene_file.hpp"

#include <filesystem>
#include <functional>
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include "worlds/error_message.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::worlds {
namespace {

using test::error_message_of;

/// A scene with one item per line, so that the tests can check line numbers in messages.
std::string example() {
  return R"({"format": "ringfence-scene", "version": 1,
 "bounds": {"min": [0,0,0], "max": [100,100,40]},
 "layers": {"names": ["solid", "ghost"], "collide": [["solid", "solid"]]},
 "shapes": {
  "ball": {"type": "sphere", "radius": 1.0},
  "crate": {"type": "box", "half_extents": [1, 0.5, 0.5]},
  "person": {"type": "capsule", "radius": 0.25, "half_height": 0.6},
  "rock": {"type": "convex_hull", "points": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]}},
 "objects": [
  {"id": 7, "shape": "ball", "category": "avatar", "user": 0, "layer": "solid",
   "position": [1,2,3], "orientation": [0,0,0,1]},
  {"id": 9, "shape": "rock", "category": "static", "layer": "ghost", "group": 4000000000, "position": [4,5,6]},
  {"id": 8, "shape": "person", "category": "non-active"}]}
)";
}

std::string replaced(const std::string& what, const std::string& with) {
  std::string text = example();
  const std::size_t at = text.find(what);
  REQUIRE_MESSAGE(at != std::string::npos, what);
  return text.replace(at, what.size(), with);
}

std::string parse_error(const std::string& text) {
  return error_message_of([&] { parse_scene(text, "s.json"); });
}

bool same(const ShapeDescription& p, const ShapeDescription& q) {
  if (p.index() != q.index()) return false;
  if (const auto* hull = std::get_if<ConvexHull>(&p)) return hull->points == std::get<ConvexHull>(q).points;
  if (const auto* box = std::get_if<Box>(&p)) return box->half_extents == std::get<Box>(q).half_extents;
  if (const auto* ball = std::get_if<Sphere>(&p)) return ball->radius == std::get<Sphere>(q).radius;
  const Capsule &c = std::get<Capsule>(p), &d = std::get<Capsule>(q);
  return c.radius == d.radius && c.half_height == d.half_height;
}

void check_same(const Scene& p, const Scene& q) {
  CHECK(p.contact_label == q.contact_label);
  CHECK(p.bounds_min == q.bounds_min);
  CHECK(p.bounds_max == q.bounds_max);
  CHECK(p.layers.names == q.layers.names);
  CHECK(p.layers.collide == q.layers.collide);
  REQUIRE(p.shapes.size() == q.shapes.size());
  for (std::size_t i = 0; i < p.shapes.size(); ++i) {
    CHECK(p.shapes[i].name == q.shapes[i].name);
    CHECK_MESSAGE(same(p.shapes[i].description, q.shapes[i].description), p.shapes[i].name);
  }
  REQUIRE(p.objects.size() == q.objects.size());
  for (std::size_t i = 0; i < p.objects.size(); ++i) {
    const ObjectSpec &a = p.objects[i], &b = q.objects[i];
    CAPTURE(a.number);
    REQUIRE(a.number == b.number);
    REQUIRE(a.shape == b.shape);
    REQUIRE(a.category == b.category);
    REQUIRE(a.user == b.user);
    REQUIRE(a.layer == b.layer);
    REQUIRE(a.group == b.group);
    REQUIRE(a.enabled == b.enabled);
    REQUIRE(a.pose == b.pose);
  }
}

}  // namespace

TEST_CASE("each field of a scene file is read") {
  const Scene scene = parse_scene(example(), "s.json");
  CHECK(scene.bounds_max == Vec3d{100, 100, 40});
  CHECK(scene.layers.names == std::vector<std::string>{"solid", "ghost"});
  REQUIRE(scene.shapes.size() == 4);
  CHECK(scene.shapes[3].name == "rock");
  CHECK(std::get<Capsule>(scene.shapes[2].description).half_height == 0.6f);
  REQUIRE(scene.objects.size() == 3);
  CHECK(scene.objects[0].number == 7);
  CHECK(scene.objects[0].category == Category::avatar);
  CHECK(scene.objects[0].user == UserId(0));
  CHECK(scene.objects[0].pose.position == Vec3d{1, 2, 3});
  CHECK(scene.objects[1].category == Category::fixed);
  CHECK(scene.objects[1].layer == 1);
  CHECK(scene.objects[1].group == 4'000'000'000);
  CHECK(scene.objects[2].group == 0);
  CHECK(scene.objects[1].shape == ShapeId(3));
  CHECK(scene.objects[2].category == Category::non_active);
  CHECK(!scene.objects[2].enabled);
  CHECK(scene.objects[2].layer == 0);
  CHECK(users_of(scene) == 1);
}

TEST_CASE("a formatted scene reads back with the same bits") {
  check_same(parse_scene(format_scene(parse_scene(example(), "s.json")), "s"), parse_scene(example(), "s.json"));
  PaperWorldOptions options;
  options.objects = 300;
  options.users = 7;
  Scene scene = make_paper_world(options).scene;
  scene.objects[3].pose.position = {1e-300, -1.7976931348623157e308, 0.1};
  scene.objects[4].pose.position = {-0.0, 5e-324, 1.0 / 3};
  scene.shapes[0].name = "a \"ball\"\n\\ \xc3\xa9";
  check_same(parse_scene(format_scene(scene), "s"), scene);
}

TEST_CASE("a written scene file reads back as the same scene") {
  const auto file = std::filesystem::temp_directory_path() / "ringfence_scene_test.json";
  const Scene scene = parse_scene(example(), "s.json");
  write_scene(file, scene);
  check_same(read_scene(file), scene);
  std::filesystem::remove(file);
  CHECK(error_message_of([&] { read_scene(file); }) == file.string() + ": cannot be opened: No such file or directory");
}

TEST_CASE("each error in a scene is reported with line, field, found value and expectation") {
  struct Case {
    const char *what, *with, *message;
  };
  const Case cases[] = {
      {"\"version\": 1", "\"version\": 2", "s.json:1: version: found 2; expected a whole number from 1 to 1"},
      {"ringfence-scene", "scene", "s.json:1: format: found \"scene\"; expected \"ringfence-scene\""},
      {" \"bounds\": {\"min\": [0,0,0], \"max\": [100,100,40]},\n", "", "s.json:1: the field \"bounds\" is missing"},
      {"\"max\": [100,100,40]", "\"max\": [100,-1,40]",
       "s.json:2: bounds: found {\"min\":[0,0,0],\"max\":[100,-1,40]}; expected min no greater than max on each axis"},
      {"\"min\": [0,0,0]", "\"min\": [0,0]", "s.json:2: bounds.min: found [0,0]; expected three numbers [x, y, z]"},
      {"[\"solid\", \"ghost\"]", "[\"solid\", \"solid\"]",
       "s.json:3: layers.names[1]: \"solid\" occurs twice; expected distinct names"},
      {"[[\"solid\", \"solid\"]]", "[[\"solid\", \"water\"]]",
       "s.json:3: layers.collide[0][1]: found \"water\"; expected one of the layers solid, ghost"},
      {"\"radius\": 1.0", "\"radius\": -1.0",
       "s.json:5: shapes.ball: sphere radius is -1 m; expected 0.0005 to 1000000"},
      {"\"radius\": 1.0", "\"radius\": 1e300",
       "s.json:5: shapes.ball.radius: found 1e+300; expected a number within the range of float"},
      {"\"radius\": 1.0", "\"radius\": \"1\"", "s.json:5: shapes.ball.radius: found \"1\"; expected a number"},
      {"\"type\": \"sphere\"", "\"type\": \"ball\"",
       "s.json:5: shapes.ball.type: found \"ball\"; expected sphere, box, capsule, convex_hull or mesh"},
      {"\"radius\": 0.25", "\"radios\": 0.25",
       "s.json:7: shapes.person: unknown field \"radios\"; expected type, radius, half_height"},
      {"\"convex_hull\", \"points\": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]", "\"mesh\", \"file\": \"a.obj\"",
       "s.json:8: shapes.rock.file: mesh files are not supported here; expected sphere, box, capsule "
       "or convex_hull"},
      {"\"shape\": \"ball\"", "\"shape\": \"bal\"",
       "s.json:10: objects[0].shape: unknown shape \"bal\"; expected one of the 4 in \"shapes\""},
      {"\"id\": 8", "\"id\": 7", "s.json:13: objects[2].id: id 7 occurs twice; expected distinct ids"},
      {"\"id\": 8", "\"id\": 0", "s.json:13: objects[2].id: found 0; expected a whole number from 1 to 4294967295"},
      {"\"id\": 8", "\"id\": 4294967296",
       "s.json:13: objects[2].id: found 4294967296; expected a whole number from 1 to 4294967295"},
      {"\"id\": 8", "\"id\": 1.5", "s.json:13: objects[2].id: found 1.5; expected a whole number from 1 to 4294967295"},
      {"{\"id\": 8, ", "{", "s.json:13: objects[2]: the field \"id\" is missing"},
      {"\"category\": \"non-active\"", "\"category\": \"nonactive\"",
       "s.json:13: objects[2].category: found \"nonactive\"; expected avatar, active, non-active or static"},
      {" \"user\": 0,", "", "s.json:10: objects[0]: the field \"user\" is missing"},
      {"\"category\": \"static\"", "\"category\": \"static\", \"user\": 3",
       "s.json:12: objects[1].user: only an avatar has a user; remove the field or make the object an avatar"},
      {"\"user\": 0", "\"user\": 70000",
       "s.json:10: objects[0].user: found 70000; expected a whole number from 0 to 65535"},
      {"\"layer\": \"ghost\"", "\"layer\": \"air\"",
       "s.json:12: objects[1].layer: found \"air\"; expected one of the layers solid, ghost"},
      {"\"group\": 4000000000", "\"group\": 4294967296",
       "s.json:12: objects[1].group: found 4294967296; expected a whole number from 0 to 4294967295"},
      {"\"position\": [1,2,3]", "\"positon\": [1,2,3]",
       "s.json:10: objects[0]: unknown field \"positon\"; expected id, shape, category, user, layer, group, "
       "position, orientation"},
      {"\"position\": [1,2,3]", "\"position\": [1,null,3]",
       "s.json:11: objects[0].position: found [1,null,3]; expected three numbers [x, y, z]"},
      {"[0,0,0,1]}", "[0,0,0,0]}",
       "s.json:11: objects[0].orientation: found [0,0,0,0]; expected a unit quaternion (length 1 within 0.001, this "
       "one has length 0)"},
      {"[0,0,0,1]}", "[0,0,0.1,1]}",
       "s.json:11: objects[0].orientation: found [0,0,0.1,1]; expected a unit quaternion (length 1 within 0.001, this "
       "one has length 1.00499)"},
      {"\"ball\": {", "\"crate\": {", "s.json: key \"crate\" occurs twice in one object; expected once"},
  };
  for (const Case& each : cases) CHECK(parse_error(replaced(each.what, each.with)) == each.message);
}

TEST_CASE("a flat hull and a hull of too few points are refused, and the message names the shape") {
  const std::string flat = parse_error(replaced("[0,0,1]]", "[1,1,0]]"));
  CHECK_MESSAGE(flat.starts_with("s.json:8: shapes.rock: "), flat);
  CHECK_MESSAGE(flat.find("plane") != std::string::npos, flat);
  const std::string few = parse_error(replaced(",[0,0,1]]", "]"));
  CHECK_MESSAGE(few.starts_with("s.json:8: shapes.rock: "), few);
}

TEST_CASE("a JSON syntax error is reported with line and column") {
  const std::string nan = parse_error(replaced("[1,2,3]", "[1,NaN,3]"));
  CHECK_MESSAGE(nan.starts_with("s.json:11:19: not JSON: syntax error"), nan);
  const std::string cut = parse_error(example().substr(0, 200));
  CHECK_MESSAGE(cut.starts_with("s.json:5:19: not JSON: syntax error"), cut);
  CHECK(parse_error("").starts_with("s.json:1:1: not JSON"));
  CHECK(parse_error("[]") == "s.json:1: found []; expected an object { }");
  CHECK(parse_error(replaced("[1,2,3]", "[1,1e999,3]")).starts_with("s.json: JSON cannot be read"));
}

TEST_CASE("a scene of more than 64 nested levels is refused at any depth") {
  const auto nested = [](const std::string& open, const std::string& close, std::size_t levels) {
    std::string text = "{\"format\":\n";
    for (std::size_t i = 1; i < levels; ++i) text += open;
    text += "0";
    for (std::size_t i = 1; i < levels; ++i) text += close;
    return text + "}";
  };
  const std::string too_deep =
      "s.json:2:64: arrays and objects are nested more than 64 deep; expected at most 64 levels, "
      "remove the surplus brackets";
  CHECK(parse_error(nested("[", "]", 65)) == too_deep);
  CHECK(parse_error(nested("[", "]", 300'000)) == too_deep);
  CHECK(parse_error(std::string(300'000, '['))
            .starts_with("s.json:1:65: arrays and objects are nested more than 64 deep"));
  CHECK(parse_error(nested("{\"a\":", "}", 300'000)).find("nested more than 64 deep") != std::string::npos);
  // 64 levels are accepted, so the error message is about the type of the value.
  CHECK(parse_error(nested("[", "]", 64)).starts_with("s.json:1: format: found [[[["));
  // Brackets in strings do not count, not even after an escaped quote.
  CHECK(parse_error("{\"format\": \"\\\"" + std::string(100, '[') + "\"}")
            .starts_with("s.json:1: format: found \"\\\"[[["));
  // Closed brackets do not count.
  std::string wide = "{\"format\": [";
  for (int i = 0; i < 100; ++i) wide += "[[]],";
  CHECK(parse_error(wide + "0]}").starts_with("s.json:1: format: found [[[]]"));
}

TEST_CASE("a scene file without one of its bytes is either refused or read completely") {
  const std::string text = example();
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string damaged = text;
    damaged.erase(at, 1);
    std::size_t objects = 3;
    const std::string message = error_message_of([&] { objects = parse_scene(damaged, "s.json").objects.size(); });
    CHECK(objects == 3);
    if (!message.empty()) CHECK_MESSAGE(message.starts_with("s.json"), message);
  }
}

TEST_CASE("a scene may say what a contact means, in 1 to 40 bytes without control characters") {
  CHECK(parse_scene(example(), "s.json").contact_label.empty());
  const auto labelled = [](const std::string& label) {
    return replaced("\"version\": 1,", "\"version\": 1, \"contact_label\": \"" + label + "\",");
  };
  const Scene scene = parse_scene(labelled("loss of separation"), "s.json");
  CHECK(scene.contact_label == "loss of separation");
  check_same(scene, parse_scene(format_scene(scene), "again.json"));
  CHECK(parse_scene(labelled(std::string(40, 'x')), "s.json").contact_label.size() == 40);
  for (const std::string& wrong : {std::string(), std::string(41, 'x'), std::string("a\\u001b[2J")}) {
    CHECK(parse_error(labelled(wrong)).find("contact_label: found") != std::string::npos);
    CHECK(parse_error(labelled(wrong)).find("expected 1 to 40 bytes without control characters") != std::string::npos);
  }
}

TEST_CASE("a scene passes mesh paths, relative to its folder, to the mesh loader") {
  const std::string text =
      replaced("\"convex_hull\", \"points\": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]", "\"mesh\", \"file\": \"a/b.obj\"");
  std::filesystem::path loaded;
  const MeshLoader loader = [&](const std::filesystem::path& file) {
    loaded = file;
    return TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}};
  };
  const Scene scene = parse_scene(text, "s.json", "/somewhere", loader);
  CHECK(loaded == "/somewhere/a/b.obj");
  CHECK(std::get<TriangleMesh>(scene.shapes[3].description).vertices.size() == 3);
  CHECK(scene.shapes[3].mesh_file == "a/b.obj");
  CHECK(format_scene(scene).find("{\"type\": \"mesh\", \"file\": \"a/b.obj\"}") != std::string::npos);
  const MeshLoader broken = [](const std::filesystem::path&) -> TriangleMesh { throw Error("no such mesh"); };
  CHECK(error_message_of([&] { parse_scene(text, "s.json", "", broken); }) ==
        "s.json:8: shapes.rock.file: no such mesh");
}

}  // namespace ringfence::worlds
