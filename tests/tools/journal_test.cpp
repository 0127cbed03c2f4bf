// `run --journal`, `resume` and `journal`: runs that are stopped and killed, and journals that do not fit.
#include <cstdint>
#include <fstream>
#include <random>
#include <string>

#include <doctest/doctest.h>
#include <signal.h>

#include "tools/program.hpp"
#include "tools/running_program.hpp"

namespace ringfence::test {
namespace {

constexpr const char* world = " --objects 400 --users 20 --warmup 3 --quiet ";

std::string digest_of(const std::string& arguments) {
  const ProgramResult result = ringfence(arguments);
  CAPTURE(result.out);
  REQUIRE(result.code == 0);
  return digest_in(result.out);
}

TEST_CASE("a run that stopped continues with other nodes, deployment and placement, and with the digest of one run") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal";
  const std::string expected = digest_of(std::string("run --frames 90") + world);
  const std::string first = digest_of("run --frames 30 --snapshot-every 8 --journal " + journal + world);
  CHECK(first != expected);
  CHECK(digest_of("resume " + journal + " --frames 30 --quiet") == first);  // nothing is left to do
  (void)digest_of("resume " + journal + " --frames 50 --nodes 3 --deployment user --check --quiet");
  (void)digest_of("resume --frames 70 --broad-phase region --nodes 2 " + journal + " --quiet --sync always");
  CHECK(digest_of("resume " + journal + " --frames 90 --nodes 0 --deployment=user-server --quiet") == expected);
  const ProgramResult list = ringfence("journal " + journal + " --verify");
  CAPTURE(list.out);
  CHECK(list.code == 0);
  CHECK(list.out.find("\nverified") != std::string::npos);
  CHECK(list.out.find("frames      ") != std::string::npos);
  CHECK(list.out.find("gaps") == std::string::npos);
}

TEST_CASE("a journal keeps the limit of contacts, for `resume` and for each frame") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal";
  const std::string crowd = std::string(" --coverage 0.3 --deepest-contacts 1") + world;
  const std::string expected = digest_of("run --frames 40" + crowd);
  CHECK(expected != digest_of(std::string("run --frames 40 --coverage 0.3") + world));
  (void)digest_of("run --frames 20 --snapshot-every 8 --journal " + journal + crowd + "--collisions " +
                  (folder / "all.csv"));
  const ProgramResult one = ringfence("journal " + journal + " --frame 15 --collisions -");
  CHECK(one.code == 0);
  CHECK(one.out == run_shell("awk -F, 'NR == 1 || $1 == 15' " + (folder / "all.csv")).out);
  CHECK(digest_of("resume " + journal + " --frames 40 --nodes 3 --broad-phase region --check --quiet") == expected);
}

TEST_CASE("any frame of a journal has the contacts of the run") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal";
  (void)digest_of("run --frames 40 --snapshot-every 7 --keep-snapshots 100 --journal " + journal + world +
                  "--collisions " + (folder / "all.csv"));
  for (const int frame : {0, 1, 17, 18, 39}) {
    CAPTURE(frame);
    const ProgramResult one = ringfence("journal " + journal + " --frame " + std::to_string(frame) + " --collisions -");
    CHECK(one.code == 0);
    const ProgramResult expected =
        run_shell("awk -F, 'NR == 1 || $1 == " + std::to_string(frame) + "' " + (folder / "all.csv"));
    CHECK(one.out == expected.out);
    CHECK(one.out.size() > 100);
  }
  const ProgramResult missing = ringfence("journal " + journal + " --frame 40 --collisions -");
  CHECK(missing.code == 2);
  CHECK(missing.out.find("missing") != std::string::npos);
}

TEST_CASE("a run that is killed at a random frame continues with the digest of one run") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  const std::string expected = digest_of(std::string("run --frames 400") + world);
  for (const char* const sync : {"always", "snapshot", "never"}) {
    CAPTURE(sync);
    const TemporaryFolder folder;
    const std::string journal = folder / "journal";
    {
      // It waits until its contacts are read, so it is killed in about the frame whose contacts were read last.
      RunningProgram run({"run", "--objects", "400", "--users", "20", "--warmup", "3", "--quiet", "--frames", "400",
                          "--snapshot-every", "50", "--sync", sync, "--journal", journal, "--collisions", "-"},
                         folder / "err");
      REQUIRE(run.started());
      for (std::uint32_t blocks = 1 + static_cast<std::uint32_t>(random() % 60); blocks > 0; --blocks) {
        REQUIRE(!run.read_some().empty());
      }
      run.signal(SIGKILL);
    }
    CHECK(digest_of("resume " + journal + " --frames 400 --quiet") == expected);
  }
}

TEST_CASE("a replay continues, but not with another motion file") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal";
  REQUIRE(ringfence("record --frames 40 --out " + (folder / "r") + world).code == 0);
  const std::string files = "--scene " + (folder / "r.json") + " --motion " + (folder / "r.bin") + " --quiet ";
  const std::string expected = digest_of("replay " + files);
  (void)digest_of("replay " + files + " --frames 20 --snapshot-every 9 --journal " + journal);
  CHECK(digest_of("resume " + journal + " --frames 40 --quiet") == expected);
  REQUIRE(ringfence("record --frames 40 --seed 2 --out " + (folder / "r") + world).code == 0);
  const ProgramResult other = ringfence("resume " + journal + " --frames 40 --quiet");
  CHECK(other.code == 2);
  CHECK(other.out.find("restore it with the same model") != std::string::npos);
}

TEST_CASE("journals that do not fit are refused with exit code 2, the file and the remedy") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal", nothing = folder / "nothing";
  (void)digest_of("run --frames 10 --journal " + journal + world);
  const auto refused = [&](const std::string& arguments, const char* text) {
    const ProgramResult result = ringfence(arguments);
    CAPTURE(result.out);
    CHECK(result.code == 2);
    CHECK(result.out.find(text) != std::string::npos);
  };
  refused("run --frames 10 --journal " + journal + world, "exists: continue it with resume");
  refused("resume " + nothing, "does not exist");
  refused("journal " + nothing, "does not exist");
  refused("resume " + journal + " --frames 5", "--frames: found 5; expected at least 10");
  refused("resume " + journal + " --objects 5", "--objects");
  refused("resume " + journal + " --users 5 --frames 20 --nodes 2000", "--nodes");
  refused("run --frames 10 --snapshot-every 0 --journal " + nothing + world, "--snapshot-every");
  refused("journal " + journal + " --frame 3", "--collisions");
  std::ofstream(journal + "/journal.db", std::ios::binary) << "not a database, and long enough to be read as one";
  refused("resume " + journal, "journal.db");
  refused("journal " + journal, "journal.db");
}

}  // namespace
}  // namespace ringfence::test
