#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

void check_refused(const std::string& arguments, const std::string& message) {
  const ProgramResult result = test::ringfence(arguments);
  CHECK_MESSAGE(result.code == 2, arguments);
  CHECK_MESSAGE(result.out.find(message) != std::string::npos, arguments, ": ", result.out);
}

}  // namespace

TEST_CASE("an option out of range ends the program with 2 and a message with its name and range") {
  check_refused("run --nodes 1025", "--nodes: found 1025; expected 0 to 1024");
  check_refused("run --nodes -1", "--nodes: found -1; expected 0 to 1024");
  check_refused("run --nodes two", "--nodes: found two; expected 0 to 1024");
  check_refused("run --frames 0", "--frames: found 0; expected 1 to 10000000");
  check_refused("run --objects 0", "--objects: found 0; expected 1 to 10000000");
  check_refused("run --coverage 0.7", "--coverage: found 0.7; expected 1e-06 to 0.6");
  check_refused("run --coverage nan", "--coverage: found nan; expected 1e-06 to 0.6");
  check_refused("run --users 0", "--users: found 0; expected 1 to 65536");
  check_refused("run --user-threads 300", "--user-threads: found 300; expected 1 to 256");
  check_refused("run --interest -1", "--interest: found -1; expected 0 to 1000000000");
  check_refused("run --ring-bytes 5000",
                "--ring-bytes: found 5000; expected 0 or a power of two from 4096 to 1073741824");
  check_refused("run --target-interval 5", "--target-interval: found 5; expected A:B frames with 1 <= A <= B");
  check_refused("run --retarget-interval 9:3", "--retarget-interval: found 9:3; expected A:B frames with 1 <= A <= B");
  check_refused("run --objects 50", "users: 100; expected at most one for each of the 50 objects");
}

TEST_CASE("an unknown value of an option ends the program with 2 and a list of its values") {
  check_refused("run --deployment cloud",
                "--deployment: found cloud; expected one of user, user-server, user-collision");
  check_refused("run --broad-phase none", "--broad-phase: found none; expected one of server, region, auto");
  check_refused("run --objects 10 --objects 20", "--objects: given 2 times; expected once");
  check_refused("run --shapes cone", "--shapes: found cone; expected one of sphere, box, capsule, hull, mixed, mesh");
  check_refused("convert walk in --out p", "KIND: found walk; expected one of air, crowd");
}

TEST_CASE("an unknown option ends the program with 2 and a message that names it first, and what may be meant") {
  check_refused("run --node 2", "ringfence: --node: unknown option; did you mean --nodes?");
  check_refused("run --ndoes=2 --quiet", "ringfence: --ndoes: unknown option; did you mean --nodes?");
  check_refused("run --broad server", "ringfence: --broad: unknown option; did you mean --broad-phase?");
  check_refused("run --velocity 3", "ringfence: --velocity: unknown option\n");
  check_refused("run -x", "ringfence: -x: unknown option\n");
  check_refused("replay --scen a --motion b", "ringfence: --scen: unknown option; did you mean --scene?");
  check_refused("replay --scene a --motion b --objects 3",
                "ringfence: --objects: not an option of replay; run, record, scale, profile and serve have it");
  check_refused("--nodes 2 run", "ringfence: --nodes: expected after the command\n");
}

TEST_CASE("an unknown command or argument ends the program with 2 and a message that names it first") {
  check_refused(
      "fly",
      "ringfence: fly: unknown command; expected run, replay, record, scale, profile, node, convert, resume, journal, "
      "serve, token or robots");
  check_refused("rnu", "ringfence: rnu: unknown command; did you mean run?");
  check_refused("",
                "ringfence: found no command; expected run, replay, record, scale, profile, node, convert, resume, "
                "journal, serve, token or robots");
  check_refused("run 12", "ringfence: 12: unexpected argument; options of run start with --");
}

TEST_CASE("an option without its value, or with one that excludes it, ends the program with 2") {
  check_refused("run --nodes", "ringfence: --nodes: found no value; expected N\n");
  check_refused("run --deployment", "--deployment: found no value; expected user, user-server or user-collision");
  check_refused("run --soak 1 --json file", "ringfence: --json: not possible together with --soak");
  check_refused("run --seed -1", "--seed: found -1; expected 0 to 18446744073709551615");
  check_refused("node --config /nowhere", "--config: found /nowhere; expected a file that exists");
}

TEST_CASE("the help of every command lists each option under the heading of its group, and the exit codes") {
  const std::vector<std::string> headings{
      "World:", "Clients:", "Service:", "Journal:", "Nodes in other processes:", "Faults:", "Output:", "Help:"};
  for (const char* command : {"run", "replay", "record", "scale", "profile", "node", "convert", "resume", "journal",
                              "serve", "token", "robots"}) {
    CAPTURE(command);
    const ProgramResult help = test::ringfence(std::string(command) + " --help");
    CHECK(help.code == 0);
    CHECK(help.out.find("\nExit codes:\n  0  done\n") != std::string::npos);
    std::istringstream lines(help.out);
    std::string heading, line;
    std::size_t options = 0;
    while (std::getline(lines, line)) {
      if (line.ends_with(':') && !line.starts_with(' ')) heading = line;
      if (line.starts_with("  -")) {
        ++options;
        CHECK_MESSAGE(std::find(headings.begin(), headings.end(), heading) != headings.end(), line);
      }
      CHECK_MESSAGE(line.size() <= 120, line);
    }
    CHECK(options > 3);
  }
  const std::string help = test::ringfence("run --help").out;
  const auto group_of = [&help](const std::string& option) {
    const std::size_t end = help.rfind(":\n", help.find("  " + option + " "));
    const std::size_t begin = help.rfind('\n', end) + 1;
    return help.substr(begin, end - begin);
  };
  CHECK(group_of("--objects") == "World");
  CHECK(group_of("--nodes") == "Service");
  CHECK(group_of("--fail") == "Faults");
  CHECK(group_of("--json") == "Output");
}

TEST_CASE("--help lists the commands and options, and --version the version; both end with 0") {
  CHECK(test::ringfence("--version").code == 0);
  CHECK(test::ringfence("--version").out.starts_with("ringfence 0."));
  const ProgramResult help = test::ringfence("--help");
  CHECK(help.code == 0);
  for (const char* command : {"run", "replay", "record", "scale", "profile", "convert"})
    CHECK(help.out.find(command) != std::string::npos);
  for (const char* option : {"--deployment",
                             "--nodes",
                             "--broad-phase",
                             "--frames",
                             "--warmup",
                             "--users",
                             "--user-threads",
                             "--interest",
                             "--objects",
                             "--coverage",
                             "--shapes",
                             "--seed",
                             "--targets",
                             "--target-interval",
                             "--retarget-interval",
                             "--check",
                             "--collisions",
                             "--json",
                             "--frames-csv",
                             "--trace",
                             "--ring-bytes",
                             "--pin",
                             "--resize",
                             "--balance",
                             "--balance-by",
                             "--keep-resting",
                             "--quiet",
                             "--deepest-contacts"}) {
    CHECK_MESSAGE(test::ringfence("run --help").out.find(option) != std::string::npos, option);
  }
}

TEST_CASE("an invalid file ends the program with 2 and a message with line and field, before any frame") {
  const TemporaryFolder folder;
  const std::string scene = folder / "s.json", motion = folder / "m.csv";
  const std::string good =
      "{\"format\": \"ringfence-scene\", \"version\": 1, \"bounds\": {\"min\": [0,0,0], \"max\": [9,9,9]},\n"
      "\"shapes\": {\"ball\": {\"type\": \"sphere\", \"radius\": 1}},\n"
      "\"objects\": [{\"id\": 7, \"shape\": \"ball\", \"category\": \"active\", \"position\": [1,1,1]}]}";
  worlds::write_text(scene, good);
  worlds::write_text(motion, "frame,object,x,y,z,qx,qy,qz,qw\n0,7,1,2,3,0,0,0,1\n3,7,1,2,nan,0,0,0,1\n");
  const std::string files = "replay --scene " + scene + " --motion " + motion;
  check_refused(files, motion + ":3: z: found \"nan\"; expected a finite number");
  CHECK(test::digest_in(test::ringfence(files).out).empty());

  worlds::write_text(motion, "frame,object,x,y,z,qx,qy,qz,qw\n3,7,1,2,3,0,0,0,1\n");
  check_refused(files + " --frames 5", "--frames: found 5; expected at most the 4 frames of " + motion);
  check_refused(files + " --warmup 4", "--warmup: found 4; expected less than the 4 frames of " + motion);

  worlds::write_text(scene, std::string(good).replace(good.find("radius"), 6, "size"));
  check_refused(files, scene + ":2: shapes.ball: unknown field \"size\"; expected type, radius");
  worlds::write_text(scene, "{\"format\":\n" + std::string(300'000, '[') + std::string(300'000, ']') + "}");
  check_refused(files, scene + ":2:64: arrays and objects are nested more than 64 deep; expected at most 64 levels");
  check_refused("replay --scene /nowhere.json --motion " + motion, "/nowhere.json: cannot be opened");
  check_refused("replay --motion " + motion, "--scene is required");
}

TEST_CASE("a program that is installed without libexec says before any frame what it cannot read or draw") {
  const test::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "bin");
  std::filesystem::copy_file(RINGFENCE_PROGRAM, folder / "bin/ringfence");
  worlds::write_text(folder / "rock.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  worlds::write_text(folder / "scene.json", R"({"format": "ringfence-scene", "version": 1,
    "bounds": {"min": [-5, -5, -5], "max": [5, 5, 5]}, "shapes": {"rock": {"type": "mesh", "file": "rock.obj"}},
    "objects": [{"id": 1, "shape": "rock", "category": "active", "position": [0, 0, 0]}]})");
  worlds::write_text(folder / "motion.csv", "frame,object,x,y,z,qx,qy,qz,qw\n0,1,2,0,0,0,0,0,1\n");
  const std::string program = folder / "bin/ringfence";
  const auto mesh = test::run_shell(program + " replay --scene " + (folder / "scene.json") + " --motion " +
                                    (folder / "motion.csv") + " 2>&1");
  CHECK(mesh.code == 2);
  CHECK_MESSAGE(mesh.out.find("rock.obj: cannot start ") != std::string::npos, mesh.out);
  const auto picture =
      test::run_shell(program + " run --objects 20 --users 2 --frames 1 --picture " + (folder / "p.png") + " 2>&1");
  CHECK(picture.code == 2);
  CHECK_MESSAGE(picture.out.find("--picture: cannot draw PNG: ") != std::string::npos, picture.out);
  CHECK(test::digest_in(picture.out).empty());
  CHECK_FALSE(std::filesystem::exists(folder / "p.png"));
}

TEST_CASE("an output file that cannot be opened ends the program with 2 before any frame") {
  for (const char* option : {"--json", "--frames-csv", "--collisions", "--trace"}) {
    check_refused(std::string("run --objects 200 --frames 1 ") + option + " /nowhere/file",
                  "/nowhere/file: cannot be opened for writing");
  }
  check_refused("record --objects 200 --frames 1 --out /nowhere/run", "/nowhere/run.json: cannot be written");
}

}  // namespace ringfence
