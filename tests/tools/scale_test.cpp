#include <cstdlib>
#include <filesystem>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "progress.hpp"
#include "scale_rows.hpp"
#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

const std::string small_world = "scale --objects 120,200 --users 10 --frames 4 --warmup 2 --repeats 2 ";

std::size_t count_of(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

tools::ScaleRow row_with(std::uint32_t nodes, std::vector<double> path_ms, std::uint64_t digest = 1) {
  tools::ScaleRow row;
  row.nodes = nodes;
  row.objects = 100;
  for (const double ms : path_ms) {
    tools::ScaleSample sample;
    sample.path_ms = ms;
    sample.undisturbed_ms = ms / 2;
    sample.wall_ms = 2 * ms;
    sample.digest = digest;
    row.samples.push_back(sample);
  }
  return row;
}

}  // namespace

TEST_CASE("the Karp-Flatt fraction of a time that follows Amdahl's law is its serial fraction") {
  for (const double serial : {0.0, 0.04, 0.5, 1.0}) {
    for (const std::uint32_t nodes : {2u, 16u, 1024u}) {
      const tools::Scaling scaling = tools::scaling_of(10, 10 * serial + 10 * (1 - serial) / nodes, nodes);
      CHECK(scaling.known);
      CHECK(scaling.serial_fraction == doctest::Approx(serial));
      CHECK(scaling.efficiency == doctest::Approx(scaling.speedup / nodes));
    }
  }
  CHECK_FALSE(tools::scaling_of(0, 1, 2).known);
}

TEST_CASE("summarise computes median and range of the repeats, and whether there are enough cores for wall times") {
  std::vector<tools::ScaleRow> rows{row_with(1, {3, 1, 2}), row_with(2, {1, 1}), row_with(0, {5})};
  tools::summarise(rows, 0.5, 2);
  CHECK(rows[0].modelled.median == 2.5);
  CHECK(rows[0].modelled.min == 1.5);
  CHECK(rows[0].modelled.max == 3.5);
  CHECK(rows[0].wall.median == 4);
  CHECK(rows[1].modelled_scaling.speedup == doctest::Approx(2.5 / 1.5));
  CHECK(rows[1].wall_scaling.speedup == doctest::Approx(2));
  CHECK(rows[0].undisturbed.median == 1.5);
  CHECK(rows[1].undisturbed_scaling.speedup == doctest::Approx(1.5));
  CHECK(rows[2].modelled.median == 5);  // one thread: no messages between threads
  CHECK(rows[0].cores_suffice);
  CHECK_FALSE(rows[1].cores_suffice);
  CHECK(rows[2].cores_suffice);
}

TEST_CASE("runs with one object count but different digests are reported") {
  CHECK(tools::digest_disagreements({row_with(1, {1, 1}, 7), row_with(2, {1}, 7)}).empty());
  const auto lines = tools::digest_disagreements({row_with(1, {1}, 7), row_with(2, {1}, 8)});
  REQUIRE(lines.size() == 1);
  CHECK(lines[0].find("2 nodes: digest 0000000000000008; expected 0000000000000007") != std::string::npos);
}

TEST_CASE("time_left returns text after the first second, if any work is done") {
  CHECK(tools::time_left(0.5, 0.5).empty());
  CHECK(tools::time_left(10, 0).empty());
  CHECK(tools::time_left(10, 0.5) == ", 10 s left");
  CHECK(tools::time_left(100, 0.25) == ", 5 min left");
  CHECK(tools::time_left(100, 1) == ", 0 s left");
}

TEST_CASE("scale runs every combination, with the digests of run") {
  const TemporaryFolder folder;
  const std::string json = folder / "s.json", csv = folder / "s.csv";
  const ProgramResult result =
      test::ringfence(small_world + "--nodes 0,1,3 --broad-phase server,region,auto --json " + json + " --csv " + csv);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  const auto columns = [&result](const std::string& first) {
    const std::size_t begin = result.out.rfind('\n', result.out.find(first)) + 1;
    return result.out.substr(begin, result.out.find('\n', begin) - begin);
  };
  // Each name of a measured column has its kind below, right-aligned (frame ms: left-aligned).
  const std::string names = columns("deployment     broad"), kinds = columns("wall time     ");
  REQUIRE(names.size() == kinds.size());
  CHECK(names.find("frame ms") == kinds.find("wall time"));
  const std::vector<std::pair<std::string, std::string>> measured{
      {"server", "CPU"},        {"node", "CPU"},          {"users", "CPU"},
      {"frame", "modelled"},    {"speedup", "modelled"},  {"efficiency", "modelled"},
      {"serial", "modelled"},   {"frame", "undisturbed"}, {"speedup", "undisturbed"},
      {"serial", "undisturbed"}};
  std::size_t end = names.find("frame ms") + std::string("frame ms").size();
  for (const auto& column : measured) {
    const std::string &name = column.first, &kind = column.second;
    end = names.find(name, end) + name.size();
    CHECK_MESSAGE(kinds.substr(end - kind.size(), kind.size()) == kind, name);
  }
  CHECK(result.out.find('\r') == std::string::npos);  // no progress line without a terminal

  const auto report = nlohmann::json::parse(worlds::read_text(json));
  CHECK(report["runs"].size() == 2 * 3 * 3 * 3);
  CHECK(count_of(worlds::read_text(csv), "\n") == 1 + 2 * 3 * 3 * 3);
  for (const char* objects : {"120", "200"}) {
    const ProgramResult run =
        test::ringfence(std::string("run --users 10 --frames 4 --warmup 2 --nodes 2 --objects ") + objects);
    const std::string digest = test::digest_in(run.out);
    CHECK(digest.size() == 16);
    for (const auto& each : report["runs"]) {
      if (each["objects"].dump() == objects) CHECK(each["digest"] == digest);
    }
  }
  for (const auto& each : report["runs"]) {
    CHECK(each["wall_ms"]["min"] <= each["wall_ms"]["max"]);
    CHECK(each["modelled_ms"]["median"] >= each["server_cpu_ms"]["min"]);
    CHECK(each["modelled_scaling"].is_null() == (each["nodes"] == 0));
    CHECK(each["undisturbed_ms"]["median"] > 0);
    CHECK(each["undisturbed_scaling"].is_null() == (each["nodes"] == 0));
    if (each["nodes"] == 0) CHECK(each["undisturbed_ms"] == each["modelled_ms"]);
  }
}

TEST_CASE("a cluster model prints its costs with their sources, and `today` extrapolates to 1024 nodes") {
  const ProgramResult result = test::ringfence(small_world + "--nodes 1,2 --model 2004,today --cost latency_us=123");
  REQUIRE_MESSAGE(result.code == 0, result.out);
  for (const char* word : {"modelled cluster \"2004\"", "modelled cluster \"today\"", "the paper, section 4",
                           "given by --cost", "measured here", "1024*", "extrapolated", "saturates"}) {
    CHECK_MESSAGE(result.out.find(word) != std::string::npos, word);
  }
}

TEST_CASE(
    "plots are SVG and PNG files with the paper's values; without gnuplot all other files are written, exit code 3") {
  const TemporaryFolder folder;
  const std::string json = folder / "s.json", prefix = folder / "plot";
  const std::string arguments =
      "scale --objects 100,120 --users 10 --frames 2 --warmup 1 --repeats 1 --nodes 1,2 "
      "--model 2004,today --plots " +
      prefix + " --json " + json;
  if (std::system("gnuplot --version > /dev/null 2>&1") == 0) {
    const ProgramResult result = test::ringfence(arguments);
    REQUIRE_MESSAGE(result.code == 0, result.out);
    for (const char* name :
         {"graph1", "graph2", "graph3", "graph4", "path", "speedup", "cluster-2004", "cluster-today"}) {
      CHECK(worlds::read_text(prefix + "-" + name + ".svg").find("</svg>") != std::string::npos);
      CHECK(worlds::read_text(prefix + "-" + name + ".png").starts_with("\x89PNG"));
    }
    CHECK(worlds::read_text(prefix + "-graph3.svg").find("about 4100") != std::string::npos);
    CHECK(worlds::read_text(prefix + "-graph4.svg").find("over 1600") != std::string::npos);
  }
  std::filesystem::remove(json);
  const ProgramResult missing = test::ringfence(arguments, "2>&1", "PATH=/nowhere");
  CHECK(missing.code == 3);
  CHECK(missing.out.find("gnuplot: not found, so nothing was drawn; install it") != std::string::npos);
  CHECK(nlohmann::json::parse(worlds::read_text(json))["runs"].size() == 12);
  CHECK(worlds::read_text(prefix + ".gnuplot").find("about 4100") != std::string::npos);
}

TEST_CASE("scale refuses invalid options with the range or the list of valid values") {
  const auto refused = [](const std::string& arguments, const std::string& message) {
    const ProgramResult result = test::ringfence("scale " + arguments);
    CHECK_MESSAGE(result.code == 2, arguments);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, arguments, ": ", result.out);
  };
  refused("--nodes 1,2000", "--nodes: found 2000; expected 0 to 1024");
  refused("--objects 0", "--objects: found 0; expected 1 to 10000000");
  refused("--repeats 0", "--repeats: found 0; expected 1 to 1000");
  refused("--deployment user,cloud", "--deployment: found cloud; expected some of user, user-server, user-collision");
  refused("--broad-phase here", "--broad-phase: found here; expected some of server, region, auto");
  refused("--model 1999", "--model: found 1999; expected 2004 or today");
  refused("--cost speed=3", "--cost: found speed=3; expected NAME=VALUE");
  refused("--objects 50,4000", "--users: found 100; expected at most one for each of the 50 objects of --objects");
  refused("--json /nowhere/file", "/nowhere/file: cannot be opened for writing");
  refused("--plots /nowhere/p", "/nowhere/p.gnuplot: cannot be opened for writing");
}

}  // namespace ringfence
