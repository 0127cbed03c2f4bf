// Queries of the program: `replay --queries --answers` and `--rays`.
#include <algorithm>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

const std::string query_header = "frame,query,kind,shape,x,y,z,qx,qy,qz,qw,dx,dy,dz,layers,except,at\n";
const std::string answer_header = "frame,query,object,child,triangle,fraction,px,py,pz,nx,ny,nz,distance\n";

/// A ball, number 7, that comes to a crate, number 9; and a square of two triangles at z = 0, number 20.
struct SmallWorld {
  TemporaryFolder folder;
  std::string scene = folder / "s.json", motion = folder / "m.csv", queries = folder / "q.csv";
  std::string answers = folder / "a.csv";

  SmallWorld() {
    worlds::write_text(folder / "floor.obj", "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3\nf 1 3 4\n");
    worlds::write_text(scene,
                       R"({"format": "ringfence-scene", "version": 1, "bounds": {"min": [0,0,0], "max": [9,9,9]},
            "layers": {"names": ["players", "walls"], "collide": [["players", "walls"]]},
            "shapes": {"ball": {"type": "sphere", "radius": 1}, "floor": {"type": "mesh", "file": "floor.obj"},
                       "crate": {"type": "box", "half_extents": [1, 0.5, 0.5]}},
            "objects": [
              {"id": 9, "shape": "crate", "category": "static", "layer": "walls", "position": [5,2,3]},
              {"id": 20, "shape": "floor", "category": "static", "layer": "walls", "position": [0,0,0]},
              {"id": 7, "shape": "ball", "category": "active", "layer": "players", "position": [1,2,3]}]})");
    worlds::write_text(motion,
                       "frame,object,x,y,z,qx,qy,qz,qw\n0,7,1,2,3,0,0,0,1\n1,7,2.5,2,3,0,0,0,1\n2,7,3.5,2,3,0,0,0,1\n"
                       "3,7,,,,,,,\n");
  }

  ProgramResult replay(const std::string& rows, const std::string& options = "") const {
    worlds::write_text(queries, query_header + rows);
    return test::ringfence("replay --check --scene " + scene + " --motion " + motion + " --queries " + queries +
                           " --answers " + answers + " " + options);
  }
  std::string answers_to(const std::string& rows, const std::string& options = "") const {
    const ProgramResult result = replay(rows, options);
    CHECK_MESSAGE(result.code == 0, result.out);
    const std::string text = worlds::read_text(answers);
    CHECK(text.starts_with(answer_header));
    return text.substr(answer_header.size());
  }
  void check_refused(const std::string& rows, const std::string& message) const {
    const ProgramResult result = replay(rows);
    CHECK_MESSAGE(result.code == 2, rows);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, rows, result.out);
  }
};

/// The value after `name` in a report, up to the end of the line.
std::string after(const std::string& report, const std::string& name) {
  const std::size_t at = report.find(name);
  if (at == std::string::npos) return {};
  const std::size_t begin = at + name.size();
  return report.substr(begin, report.find('\n', begin) - begin);
}

const std::string one_of_each_kind =
    "0,1,ray,,5,2,8,,,,,0,0,-16,,,\n"
    "0,2,ray_any,,5,2,8,,,,,0,0,-16,,,\n"
    "0,3,ray_any,,5,2,8,,,,,0,0,4,,,\n"
    "0,4,ray_all,,5,2,8,,,,,0,0,-16,,,\n"
    "1,1,ray,,5,2,8,,,,,0,0,-16,,9,\n"
    "1,2,overlap,ball,3.25,2,3,,,,,,,,,,\n"
    "1,3,nearest,,2.5,2,3,,,,,5,,,,7,\n"
    "1,4,nearest,,2.5,2,3,,,,,5,,,,,\n"
    "1,5,nearest,,2.5,2,6,,,,,0.5,,,,,\n"
    "2,1,sweep,ball,5.25,8,3,,,,,0,-8,0,,,\n"
    "2,2,sweep_all,ball,0,2,3,,,,,8,0,0,,,\n"
    "2,3,overlap,ball,4,2,2,0,0,1,0,0,0,0,players,,2\n"
    "3,1,overlap,ball,4,2,2,,,,,,,,,,\n";

}  // namespace

TEST_CASE("a replay answers the queries of each kind, and all answers agree with brute force") {
  const SmallWorld world;
  CHECK(world.answers_to(one_of_each_kind) ==
        "0,1,9,0,0,0.28125,5,2,3.5,0,0,1,0\n"
        "0,2,0,0,0,0,0,0,0,0,0,0,0\n"
        "0,4,9,0,0,0.28125,5,2,3.5,0,0,1,0\n"
        "0,4,20,0,0,0.5,5,2,0,0,0,1,0\n"
        "1,1,20,0,0,0.5,5,2,0,0,0,1,0\n"
        "1,2,7,0,0,0,0,0,0,0,0,0,0\n"
        "1,2,9,0,0,0,0,0,0,0,0,0,0\n"
        "1,3,9,0,0,0,4,2,3,0,0,0,1.5\n"
        "1,4,7,0,0,0,2.5,2,3,0,0,0,0\n"
        "2,1,9,0,0,0.5625,5.25,2.5,3,0,1,0,0\n"
        "2,2,7,0,0,0.1875,2.5,2,3,-1,0,0,0\n"
        "2,2,9,0,0,0.375,4,2,3,-1,0,0,0\n"
        "2,3,7,0,0,0,0,0,0,0,0,0,0\n"
        "3,1,9,0,0,0,0,0,0,0,0,0,0\n");
}

TEST_CASE("the frames of queries are counted frames, as those of the contacts") {
  const SmallWorld world;
  CHECK(world.answers_to("1,5,nearest,,3,2,3,,,,,5,,,players,,\n", "--warmup 1") == "1,5,7,0,0,0,3,2,3,0,0,0,0\n");
  const ProgramResult result = world.replay("3,5,nearest,,3,2,3,,,,,5,,,players,,\n", "--warmup 1");
  CHECK(result.code == 2);
  CHECK(result.out.find(":2: frame: found 3; expected less than 3, the number of counted frames") != std::string::npos);
}

TEST_CASE("with a history, queries ask about earlier frames and the time between two") {
  const SmallWorld world;
  const std::string rows =
      "3,1,nearest,,0,2,3,,,,,9,,,players,,1\n"
      "3,2,nearest,,0,2,3,,,,,9,,,players,,1.5\n"
      "3,3,nearest,,0,2,3,,,,,9,,,players,,2.5\n"  // it is absent in frame 3
      "3,4,nearest,,0,2,3,,,,,9,,,players,,3\n"
      "3,5,overlap,ball,0,2,3,,,,,,,,players,,0\n";
  const std::string expected =
      "3,1,7,0,0,0,1.5,2,3,0,0,0,1.5\n"
      "3,2,7,0,0,0,2,2,3,0,0,0,2\n"
      "3,3,7,0,0,0,2.5,2,3,0,0,0,2.5\n"
      "3,5,7,0,0,0,0,0,0,0,0,0,0\n";
  for (const std::string nodes : {"0", "3"}) {
    CHECK(world.answers_to(rows, "--history 3 --nodes " + nodes) == expected);
    CHECK(world.answers_to(rows, "--history 9 --nodes " + nodes) == expected);
  }
  CHECK(world.answers_to("1,1,nearest,,0,2,3,,,,,9,,,players,,0.5\n", "--warmup 1 --history 1") ==
        "1,1,7,0,0,0,2,2,3,0,0,0,2\n");
  const ProgramResult result = world.replay(rows, "--history 1");
  CHECK(result.code == 2);
  CHECK_MESSAGE(result.out.find(":2: at: found \"1\"; expected a frame from 2 to 3, or nothing for this one; --history "
                                "has 1") != std::string::npos,
                result.out);
}

TEST_CASE("the report, its JSON and the profile count queries and have the digest of the answers") {
  const SmallWorld world;
  const std::string json = world.folder / "r.json";
  const ProgramResult result = world.replay(one_of_each_kind, "--json " + json);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  CHECK(after(result.out, "\nqueries     ").starts_with("3.2 per frame, 3.5 hits; "));
  CHECK(after(result.out, "\ncheck       ") == "4 frames agree with brute force in double precision");
  CHECK(result.out.find("check       13 answers of 4 frames agree with brute force in double precision\n") !=
        std::string::npos);
  const auto report = nlohmann::json::parse(worlds::read_text(json));
  CHECK(report["queries"]["total"] == 13);
  CHECK(report["queries"]["hits"] == 14);
  CHECK(report["queries"]["tests"] >= 14);
  CHECK(report["queries"]["boxes"] >= report["queries"]["tests"]);
  CHECK(report["queries"]["ms"] > 0.0);
  CHECK(report["queries"]["failed_supports"] == 0);
  CHECK(report["check"]["answers"] == 13);
  CHECK(report["check"]["differences"] == 0);
  const std::string digest = report["answer_digest"];
  CHECK(digest.size() == 16);
  CHECK(after(result.out, "\nanswers     ") == "14 in total, digest " + digest);

  const ProgramResult profile = test::ringfence("profile --objects 200 --frames 2 --warmup 0 --rays 20 --nodes 1");
  CHECK(after(profile.out, "\nqueries     ").starts_with("20.0 per frame, "));
  CHECK(after(profile.out, "\nanswers     ").find("digest ") != std::string::npos);
}

TEST_CASE("answers to standard output leave the report to standard error") {
  const SmallWorld world;
  worlds::write_text(world.queries, query_header + "0,1,nearest,,5,2,5,,,,,5,,,,,\n");
  const std::string arguments =
      "replay --scene " + world.scene + " --motion " + world.motion + " --queries " + world.queries + " --answers -";
  CHECK(test::ringfence(arguments, "2>/dev/null").out == answer_header + "0,1,9,0,0,0,5,2,3.5,0,0,0,1.5\n");
  CHECK(test::digest_in(test::ringfence(arguments, "2>&1 >/dev/null").out).size() == 16);
  const ProgramResult both = test::ringfence(arguments + " --collisions -");
  CHECK(both.code == 2);
  CHECK(both.out.find("--answers: found - together with --collisions -; expected a file for one of them") !=
        std::string::npos);
}

TEST_CASE("a query that cannot be asked ends the program with 2 and a message with file and line, before any frame") {
  const SmallWorld world;
  const std::string at = world.queries + ":2: ";
  world.check_refused("0,1,sweep,bal,0,0,0,,,,,1,0,0,,,\n", at + "shape: found \"bal\"; expected the name of a shape");
  world.check_refused("0,1,overlap,floor,0,0,0,,,,,,,,,,\n",
                      at + "shape: \"floor\" is a mesh; expected a convex shape");
  world.check_refused("0,1,ray,,nan,0,0,,,,,1,0,0,,,\n", at + "x: found \"nan\"; expected a finite number");
  world.check_refused("0,1,sweep,ball,0,0,0,0,0,0,0,1,0,0,,,\n",
                      at + "qx,qy,qz,qw: found (0, 0, 0, 0); expected a unit quaternion");
  world.check_refused("0,1,ray,,0,0,0,,,,,1,0,0,,,\n0,1,ray,,0,0,0,,,,,2,0,0,,,\n",
                      ":3: query: found 1 twice in frame 0; expected distinct ids in each frame");
  world.check_refused("0,1,ray,,0,0,0,,,,,1,0,0,player,,\n",
                      at + "layers: found \"player\"; expected layers of the scene, joined by +: players, walls");
  world.check_refused("0,1,ray,,0,0,0,,,,,1,0,0,,8,\n", at + "except: found \"8\"; expected the id of an object");
  world.check_refused("0,1,shot,,0,0,0,,,,,1,0,0,,,\n", at + "kind: found \"shot\"; expected one of ray, ray_any");
  world.check_refused("0,1,ray,0,0,0,1,0,0\n", at + "found 9 fields; expected 17: frame,query,kind,");
  world.check_refused("1,1,ray,,0,0,0,,,,,1,0,0,,,\n0,1,ray,,0,0,0,,,,,2,0,0,,,\n",
                      ":3: frame: found 0 after 1; expected frames in ascending order");
  world.check_refused("2,1,ray,,0,0,0,,,,,1,0,0,,,1\n",
                      at + "at: found \"1\"; expected a frame from 2 to 2, or nothing for this one");
  CHECK(test::digest_in(world.replay("0,1,shot,,0,0,0,,,,,1,0,0,,,\n").out).empty());

  const std::string files = "replay --scene " + world.scene + " --motion " + world.motion;
  for (const char* option : {"--queries", "--answers"}) {
    const ProgramResult alone = test::ringfence(files + " " + option + " " + world.queries);
    CHECK(alone.code == 2);
    const std::string other = option == std::string("--queries") ? "--answers" : "--queries";
    CHECK_MESSAGE(alone.out.find(option + std::string(": expected ") + other + " too") != std::string::npos, alone.out);
  }
  const ProgramResult missing = test::ringfence(files + " --queries /nowhere --answers " + world.answers);
  CHECK(missing.code == 2);
  CHECK(missing.out.find("/nowhere: cannot be opened") != std::string::npos);
  worlds::write_text(world.queries, query_header);
  const ProgramResult unwritable = test::ringfence(files + " --queries " + world.queries + " --answers /nowhere/a");
  CHECK(unwritable.code == 2);
  CHECK(unwritable.out.find("/nowhere/a: cannot be opened for writing") != std::string::npos);
}

TEST_CASE("answers are the same at any number of nodes and with both placements") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "run";
  REQUIRE(test::ringfence("record --objects 300 --users 10 --frames 3 --warmup 2 --nodes 1 --out " + prefix).code == 0);
  std::string rows = query_header;
  for (int query = 0; query < 120; ++query) {
    const std::string id = std::to_string(query / 40) + "," + std::to_string(query) + ",";
    const std::string place = std::to_string(query % 7 * 3.1) + "," + std::to_string(query % 11 * 2.3) + "," +
                              std::to_string(query % 13 * 1.7);
    const char* const kinds[] = {"ray,,", "ray_any,,", "ray_all,,", "nearest,,"};
    rows += id + kinds[query % 4] + place + ",,,,," + (query % 4 == 3 ? "9,,,,,\n" : "20,-3,5,,,\n");
  }
  worlds::write_text(folder / "q.csv", rows);
  std::string first_answers, first_rays;
  for (const char* nodes : {"0", "1", "4"}) {
    for (const char* placement : {"server", "region"}) {
      CAPTURE(nodes);
      CAPTURE(placement);
      const std::string service = std::string(" --quiet --nodes ") + nodes + " --broad-phase " + placement;
      const ProgramResult replay =
          test::ringfence("replay --scene " + prefix + ".json --motion " + prefix + ".bin --queries " +
                          (folder / "q.csv") + " --answers " + (folder / "a.csv") + service);
      REQUIRE_MESSAGE(replay.code == 0, replay.out);
      const std::string answers = worlds::read_text(folder / "a.csv");
      if (first_answers.empty()) first_answers = answers;
      CHECK(answers == first_answers);
      const ProgramResult run =
          test::ringfence("run --objects 300 --users 10 --frames 4 --warmup 2 --rays 50" + service);
      REQUIRE_MESSAGE(run.code == 0, run.out);
      const std::string rays = after(run.out, "\nanswers     ");
      if (first_rays.empty()) first_rays = rays;
      CHECK(rays == first_rays);
    }
  }
  CHECK(std::count(first_answers.begin(), first_answers.end(), '\n') > 50);
  CHECK(first_rays.size() > 20);
}

TEST_CASE("the random rays of a run agree with brute force, and do not change its digest") {
  const std::string run = "run --objects 500 --users 10 --frames 5 --warmup 3 --nodes 2 --shapes mixed";
  const ProgramResult with = test::ringfence(run + " --check --rays 200"), without = test::ringfence(run);
  REQUIRE_MESSAGE(with.code == 0, with.out);
  CHECK(with.out.find("check       1000 answers of 5 frames agree") != std::string::npos);
  CHECK(test::digest_in(with.out) == test::digest_in(without.out));
  CHECK(after(test::ringfence(run + " --rays 200 --seed 2").out, "\nanswers     ") !=
        after(with.out, "\nanswers     "));
  CHECK(test::ringfence("run --objects 100 --users 5 --frames 3 --warmup 0 --shapes mesh --check --rays 100").code ==
        0);
}

TEST_CASE("a run without queries reports nothing about them") {
  const TemporaryFolder folder;
  const ProgramResult result =
      test::ringfence("run --check --objects 200 --users 5 --frames 2 --warmup 0 --json " + (folder / "r.json"));
  REQUIRE(result.code == 0);
  CHECK(result.out.find("queries") == std::string::npos);
  CHECK(result.out.find("answers") == std::string::npos);
  const auto report = nlohmann::json::parse(worlds::read_text(folder / "r.json"));
  for (const char* key : {"queries", "answer_digest"}) CHECK_FALSE(report.contains(key));
  CHECK_FALSE(report["config"].contains("rays"));
  CHECK_FALSE(report["check"].contains("answers"));
}

}  // namespace ringfence
