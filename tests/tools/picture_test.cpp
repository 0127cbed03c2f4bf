#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include "picture/svg.hpp"
#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::TemporaryFolder;
using tools::PictureColors;

const std::string small_run = "run --objects 400 --users 20 --frames 40 --warmup 5 --balance-by pairs --quiet ";

std::string picture_of(const std::string& arguments, const std::string& path) {
  const test::ProgramResult result = test::ringfence(arguments + " --picture " + path);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  return worlds::read_text(path);
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

/// A big-endian number of four bytes.
std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

}  // namespace

TEST_CASE("a picture has the same bytes in every run and every deployment that has the same region maps") {
  const TemporaryFolder folder;
  const std::string first = picture_of(small_run + "--nodes 3", folder / "1.svg");
  CHECK(first.starts_with("<svg "));
  CHECK(first.find("400 objects, ") != std::string::npos);
  CHECK(first.find("3 CD nodes") != std::string::npos);
  CHECK(first.find("node 2") != std::string::npos);
  CHECK(picture_of(small_run + "--nodes 3", folder / "2.svg") == first);
  CHECK(picture_of(small_run + "--nodes 3 --deployment user-server", folder / "3.svg") == first);
  CHECK(picture_of(small_run + "--nodes 3 --broad-phase region", folder / "4.svg") == first);
  const std::string png = picture_of(small_run + "--nodes 3", folder / "1.png");
  CHECK(picture_of(small_run + "--nodes 3", folder / "2.png") == png);
}

TEST_CASE("a PNG picture has twice the pixels of the SVG picture") {
  const TemporaryFolder folder;
  const std::string svg = picture_of(small_run + "--nodes 1", folder / "p.svg");
  const std::string png = picture_of(small_run + "--nodes 1", folder / "p.png");
  REQUIRE(png.starts_with("\x89PNG\r\n\x1a\n"));
  const std::size_t box = svg.find("viewBox=\"0 0 ") + 13;
  std::size_t width_end = 0;
  const int width = std::stoi(svg.substr(box), &width_end);
  CHECK(number_at(png, 16) == 2 * static_cast<std::uint32_t>(width));
  CHECK(number_at(png, 20) == 2 * static_cast<std::uint32_t>(std::stoi(svg.substr(box + width_end))));
}

TEST_CASE("a picture of a replay shows the objects and contacts of the last frame") {
  const TemporaryFolder folder;
  const std::string air = RINGFENCE_DATA "/air/";
  const std::string picture =
      picture_of("replay --scene " + air + "scene.json --motion " + air + "motion.csv --nodes 2 --quiet --frames 275",
                 folder / "air.svg");
  // The rows of frame 274 of --collisions: two contacts.
  CHECK(picture.find(">24 objects, 2 contacts, 2 CD nodes<") != std::string::npos);
  CHECK(picture.find(">50 km<") != std::string::npos);
}

TEST_CASE("--picture-colors selects the colours of a picture; auto leaves the choice to the reader") {
  const TemporaryFolder folder;
  const std::string automatic = picture_of(small_run + "--nodes 2", folder / "a.svg");
  CHECK(count(automatic, "@media (prefers-color-scheme:dark)") == 1);
  CHECK(count(automatic, ".page{fill:#ffffff}") == 1);
  CHECK(count(automatic, ".page{fill:#0d1117}") == 1);
  const std::string light = picture_of(small_run + "--nodes 2 --picture-colors light", folder / "l.svg");
  CHECK(count(light, "@media") == 0);
  CHECK(count(light, ".page{fill:#ffffff}") == 1);
  const std::string dark = picture_of(small_run + "--nodes 2 --picture-colors dark", folder / "d.svg");
  CHECK(count(dark, "@media") == 0);
  CHECK(count(dark, ".page{fill:#0d1117}") == 1);
  CHECK(picture_of(small_run + "--nodes 2", folder / "l.png") !=
        picture_of(small_run + "--nodes 2 --picture-colors dark", folder / "d.png"));
}

TEST_CASE("a picture that cannot be written ends the program with 2 before any frame") {
  const auto check_refused = [](const std::string& arguments, const std::string& message) {
    const test::ProgramResult result = test::ringfence(arguments);
    CHECK(result.code == 2);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, result.out);
    CHECK(test::digest_in(result.out).empty());
  };
  check_refused(small_run + "--picture world.gif",
                "--picture: found world.gif; expected a name that ends in .svg or .png");
  check_refused(small_run + "--picture -", "--picture: found -; expected a name that ends in .svg or .png");
  check_refused(small_run + "--picture /nowhere/world.svg", "/nowhere/world.svg: cannot be opened for writing");
  check_refused(small_run + "--picture /nowhere/world.png", "/nowhere/world.png: cannot be opened for writing");
  check_refused(small_run + "--picture-colors red", "--picture-colors: found red; expected one of auto, light, dark");
}

TEST_CASE("a picture does not change the result of a run") {
  const TemporaryFolder folder;
  const auto plain = test::ringfence(small_run);
  const auto drawn = test::ringfence(small_run + "--picture " + (folder / "p.svg"));
  CHECK(test::digest_in(plain.out) == test::digest_in(drawn.out));
}

TEST_CASE("text of an SVG picture is escaped, and coordinates are rounded to tenths without an accumulated error") {
  tools::Drawing drawing{100, 50.25, "a < b & c", {}};
  tools::Polygon polygon{{}, {tools::Ink{tools::Meaning::text}, {}, 1}};
  for (int i = 0; i < 4; ++i) polygon.points.push_back({0.26 * i, -0.26 * i});
  drawing.layers.push_back({{}, false, {polygon}});
  const std::string svg = to_svg(drawing, PictureColors::light);
  CHECK(svg.find("<title>a &lt; b &amp; c</title>") != std::string::npos);
  // 0, 0.26, 0.52 and 0.78 are 0, 0.3, 0.5 and 0.8 in tenths.
  CHECK(svg.find("d=\"m0 0l.3-.3 .2-.2 .3-.3z\"") != std::string::npos);
  CHECK(svg.find("height=\"50.3\"") != std::string::npos);
}

}  // namespace ringfence
