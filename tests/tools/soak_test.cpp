#include <regex>
#include <string>

#include <doctest/doctest.h>

#include "tools/program.hpp"

namespace ringfence {

TEST_CASE("a short soak passes its checks in each deployment") {
  for (const char* deployment : {"user", "user-server", "user-collision"}) {
    CAPTURE(deployment);
    const test::ProgramResult result = test::ringfence(
        std::string("run --soak 0.03 --objects 300 --users 10 --nodes 3 --check --node-deadline-ms 60 --deployment ") +
        deployment);
    REQUIRE_MESSAGE(result.code == 0, result.out);
    CHECK(result.out.find("all checks passed") != std::string::npos);
    CHECK(result.out.find(" 0 differences") != std::string::npos);
    // On average a node joins or leaves in one frame of 40. On a busy machine there may be fewer frames.
    std::smatch frames;
    REQUIRE(std::regex_search(result.out, frames, std::regex("([0-9]+) frames, ")));
    if (std::stoi(frames[1]) >= 150) CHECK(result.out.find(" 0 resizes") == std::string::npos);
  }
}

TEST_CASE("a soak continues from its journal when its process is killed") {
  const test::TemporaryFolder folder;
  const test::ProgramResult result = test::ringfence(
      "run --soak 0.08 --objects 200 --users 10 --nodes 2 --check --node-deadline-ms 60 --sync always "
      "--snapshot-every 50 --journal " +
      (folder / "journal"));
  REQUIRE_MESSAGE(result.code == 0, result.out);
  CHECK(result.out.find("all checks passed") != std::string::npos);
  std::smatch lives;
  REQUIRE_MESSAGE(std::regex_search(result.out, lives,
                                    std::regex("lives +([0-9]+) processes, ([0-9]+) of them killed; ([0-9]+) frames "
                                               "complete, ([0-9]+) run again, 0 missing, 0 with another digest")),
                  result.out);
  CHECK(std::stoi(lives[2]) >= 1);
  CHECK(std::stoi(lives[1]) == std::stoi(lives[2]) + 1);
  CHECK(std::stoi(lives[4]) > 0);
  // What the processes left behind is a journal like others.
  const test::ProgramResult verified = test::ringfence("journal --verify " + (folder / "journal"));
  CHECK_MESSAGE(verified.code == 0, verified.out);
  CHECK(verified.out.find("verified: ") != std::string::npos);
  std::smatch last;
  REQUIRE(std::regex_search(verified.out, last, std::regex("frames +[0-9]+ to ([0-9]+)")));
  const test::ProgramResult frame =
      test::ringfence("journal " + (folder / "journal") + " --frame " + last.str(1) + " --collisions -");
  CHECK(frame.code == 0);
  CHECK(frame.out.find("\n" + last.str(1) + ",") != std::string::npos);
  // Its requests are not those of a run.
  const test::ProgramResult resumed = test::ringfence("resume " + (folder / "journal"));
  CHECK(resumed.code == 2);
  CHECK(resumed.out.find("of a soak") != std::string::npos);
  // A journal that exists is not replaced.
  CHECK(test::ringfence("run --soak 0.01 --objects 200 --journal " + (folder / "journal")).code == 2);
}

TEST_CASE("--soak refuses options that do not apply to a soak") {
  CHECK(test::ringfence("run --soak 0.01 --json out.json").code == 2);
  CHECK(test::ringfence("run --soak -1").code == 2);
}

}  // namespace ringfence
