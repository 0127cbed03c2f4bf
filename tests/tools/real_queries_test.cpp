// Queries about recorded air traffic and people, compared with brute force over the motion file.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "motion/random.hpp"
#include "tools/program.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/scene_file.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

using Positions = std::map<ObjectNumber, Vec3d>;

/// Where the objects are that are present in each frame of a motion file.
std::vector<Positions> positions_of(const worlds::Motion& motion) {
  std::vector<Positions> frames;
  Positions now;
  std::size_t next = 0;
  for (std::uint32_t frame = 0; frame < motion.frames; ++frame) {
    for (; next < motion.rows.size() && motion.rows[next].frame == frame; ++next) {
      const worlds::MotionRow& row = motion.rows[next];
      if (row.present) {
        now[row.object] = row.pose.position;
      } else {
        now.erase(row.object);
      }
    }
    frames.push_back(now);
  }
  return frames;
}

struct AnswerRow {
  ObjectNumber object;
  double distance;
};

/// The rows of an answer file by (frame, query).
std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<AnswerRow>> read_answers(const std::string& file) {
  std::istringstream lines(worlds::read_text(file));
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<AnswerRow>> answers;
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::vector<std::string> parts;
    for (std::string part; std::getline(fields, part, ',');) parts.push_back(part);
    REQUIRE(parts.size() == 13);
    const auto whole = [&](std::size_t i) { return static_cast<std::uint32_t>(std::stoul(parts[i])); };
    answers[{whole(0), whole(1)}].push_back({whole(2), std::stod(parts[12])});
  }
  return answers;
}

/// Asks one query for each object that is present, with the object's number as its id and without the object itself.
/// `fields` makes the kind and shape, `path` the fields from dx to dz.
std::string queries_about(const std::vector<Positions>& frames, const std::string& fields, const std::string& path) {
  std::ostringstream text;
  text.precision(17);
  text << "frame,query,kind,shape,x,y,z,qx,qy,qz,qw,dx,dy,dz,layers,except,at\n";
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    for (const auto& [number, p] : frames[frame]) {
      text << frame << ',' << number << ',' << fields << ',' << p.x << ',' << p.y << ',' << p.z << ",,,,," << path
           << ",," << number << ",\n";
    }
  }
  return text.str();
}

/// Distance of a point from an upright prism about the origin, whose lower half of points are the corners of its
/// base, in order.
double distance_from_prism(const std::vector<Vec3f>& points, const Vec3d& p) {
  const std::size_t sides = points.size() / 2;
  const double above = std::max(0.0, std::abs(p.z) - double{points.back().z});
  double nearest = std::numeric_limits<double>::infinity();
  bool inside = true;
  for (std::size_t i = 0; i < sides; ++i) {
    const Vec3f &a = points[i], &b = points[(i + 1) % sides];
    const double ex = double{b.x} - a.x, ey = double{b.y} - a.y, fx = p.x - a.x, fy = p.y - a.y;
    inside = inside && ex * fy - ey * fx >= 0;
    const double along = std::clamp((fx * ex + fy * ey) / (ex * ex + ey * ey), 0.0, 1.0);
    nearest = std::min(nearest, std::hypot(fx - along * ex, fy - along * ey));
  }
  return std::hypot(inside ? 0 : nearest, above);
}

Vec3d minus(const Vec3d& p, const Vec3d& q) { return {p.x - q.x, p.y - q.y, p.z - q.z}; }

/// 40 people who walk both ways through a corridor of 4 m, as text of the crowd format.
std::string make_crowd() {
  std::ostringstream text;
  for (std::uint32_t person = 1; person <= 40; ++person) {
    motion::Draws draws(31, 1, person);
    const double way = person % 2 == 0 ? 1 : -1, lane = draws.between(20, 380), start = draws.between(-600, 600);
    for (std::uint32_t frame = 0; frame < 60; ++frame) {
      text << person << ' ' << frame << ' ' << start + way * 5.2 * frame << ' ' << lane + draws.between(-3, 3)
           << " 160\n";
    }
  }
  return text.str();
}

}  // namespace

TEST_CASE("the nearest aircraft to each aircraft, in recorded air traffic, is that of brute force") {
  const std::string data = std::string(RINGFENCE_DATA) + "/air/";
  const worlds::Scene scene = worlds::read_scene(data + "scene.json");
  const std::vector<Positions> frames = positions_of(worlds::read_motion(data + "motion.csv", scene));
  const auto& prism = std::get<ConvexHull>(scene.shapes.front().description).points;
  const TemporaryFolder folder;
  const std::string queries = folder / "q.csv", answers_file = folder / "a.csv";
  worlds::write_text(queries, queries_about(frames, "nearest,", "1e6,,"));
  const ProgramResult result = test::ringfence("replay --nodes 2 --scene " + data + "scene.json --motion " + data +
                                               "motion.csv --queries " + queries + " --answers " + answers_file);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  auto answers = read_answers(answers_file);
  std::size_t asked = 0, near = 0;
  for (std::uint32_t frame = 0; frame < frames.size(); ++frame) {
    for (const auto& object : frames[frame]) {
      const auto& [number, p] = object;
      std::map<ObjectNumber, double> distances;
      double least = std::numeric_limits<double>::infinity();
      for (const auto& [other, q] : frames[frame]) {
        if (other != number) least = std::min(least, distances[other] = distance_from_prism(prism, minus(p, q)));
      }
      const std::vector<AnswerRow>& rows = answers[{frame, number}];
      CAPTURE(frame);
      CAPTURE(object.first);
      REQUIRE(rows.size() == (distances.empty() ? 0 : 1));
      if (rows.empty()) continue;
      ++asked;
      near += least < 10'000;
      CHECK(std::abs(rows[0].distance - least) < 1e-3);
      REQUIRE(distances.contains(rows[0].object));
      CHECK(distances[rows[0].object] - least < 1e-3);
    }
  }
  CHECK(asked > 6000);
  CHECK(near > 100);
}

// RINGFENCE_CROWD may name a recorded trace, uncompressed, to be used instead of the one that the test makes.
TEST_CASE("who is within 2 m of each person, in a crowd, is that of brute force") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "crowd", queries = folder / "q.csv", answers_file = folder / "a.csv";
  const char* const recorded = std::getenv("RINGFENCE_CROWD");
  const std::string trace = recorded != nullptr ? recorded : folder / "trace.txt";
  if (recorded == nullptr) worlds::write_text(trace, make_crowd());
  REQUIRE(test::ringfence("convert crowd " + trace + " --out " + prefix).code == 0);
  auto json = nlohmann::ordered_json::parse(worlds::read_text(prefix + ".json"));
  json["shapes"]["reach"] = {{"type", "sphere"}, {"radius", 2}};
  worlds::write_text(prefix + ".json", json.dump());

  const worlds::Scene scene = worlds::read_scene(prefix + ".json");
  const double person = double{std::get<Capsule>(scene.shapes.front().description).radius};
  const std::vector<Positions> frames = positions_of(worlds::read_motion(prefix + ".csv", scene));
  worlds::write_text(queries, queries_about(frames, "overlap,reach", ",,"));
  const ProgramResult result = test::ringfence("replay --nodes 2 --scene " + prefix + ".json --motion " + prefix +
                                               ".csv --queries " + queries + " --answers " + answers_file);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  auto answers = read_answers(answers_file);
  std::size_t near = 0, far = 0, wrong = 0;
  for (std::uint32_t frame = 0; frame < frames.size(); ++frame) {
    for (const auto& [number, p] : frames[frame]) {
      const std::vector<AnswerRow>& rows = answers[{frame, number}];
      for (const auto& [other, q] : frames[frame]) {
        const double gap = std::hypot(p.x - q.x, p.y - q.y) - person - 2;
        if (other == number || std::abs(gap) < 1e-5) continue;  // all have the same height
        const ObjectNumber wanted = other;
        const bool found =
            std::any_of(rows.begin(), rows.end(), [&](const AnswerRow& row) { return row.object == wanted; });
        ++(gap < 0 ? near : far);
        wrong += found != (gap < 0);
      }
      wrong += std::any_of(rows.begin(), rows.end(), [&, number = number](const AnswerRow& row) {
        return row.object == number || !frames[frame].contains(row.object);
      });
    }
  }
  CHECK(wrong == 0);
  CHECK(near > 1000);
  CHECK(far > 1000);
}

}  // namespace ringfence
