// tools/bench builds only the programs that it runs, and names the peers that are missing.
#include <filesystem>
#include <string>

#include <doctest/doctest.h>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

std::string dry_run(const std::string& build, const std::string& filter, const std::string& redirect = "2>/dev/null") {
  const test::ProgramResult result = test::run_shell(std::string(RINGFENCE_SOURCE) + "/tools/bench --dry-run --build " +
                                                     build + " '" + filter + "' " + redirect);
  REQUIRE_MESSAGE(result.code == 0, result.out);
  return result.out;
}

}  // namespace

TEST_CASE("tools/bench selects the programs whose benchmarks can match the filter") {
  const test::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "bench");
  worlds::write_text(
      folder / "bench/programs",
      "program bench_a narrow/\nprogram bench_b frame/box/ frame/mixed/\nprogram bench_c ring/ frame/empty\n"
      "lacks bench_a libfcl-dev\nlacks bench_a libbullet-dev\nlacks bench_d cyclonedds-dev\n");
  const std::string build = folder / "";
  const std::string all = "bench_a\nbench_b\nbench_c\n";
  CHECK(dry_run(build, "narrow/box_box") == "bench_a\n");
  CHECK(dry_run(build, "^narrow/") == "bench_a\n");
  CHECK(dry_run(build, "nar") == "bench_a\n");
  CHECK(dry_run(build, "narrow/(box|hull)_box$") == "bench_a\n");
  CHECK(dry_run(build, "frame/mixed/4000/") == "bench_b\n");
  CHECK(dry_run(build, "frame/") == "bench_b\nbench_c\n");
  CHECK(dry_run(build, "frame/(empty|box)") == "bench_b\nbench_c\n");
  CHECK(dry_run(build, "narrow/box|ring/") == "bench_a\nbench_c\n");
  CHECK(dry_run(build, "frames*/empty") == "bench_b\nbench_c\n");
  CHECK(dry_run(build, ".") == all);
  CHECK(dry_run(build, "/ringfence$") == all);
  CHECK(dry_run(build, "box_box") == all);

  const std::string both = dry_run(build, "narrow/", "2>&1 >/dev/null");
  CHECK(both ==
        "tools/bench: bench_a: rows are missing because these packages are not installed: libfcl-dev "
        "libbullet-dev\n");
  CHECK(dry_run(build, "ring/", "2>&1 >/dev/null").empty());
  CHECK(dry_run(build, ".", "2>&1 >/dev/null").find("bench_d: rows are missing") != std::string::npos);
}

// Without this, tools/bench could leave out a program that has benchmarks of the name.
TEST_CASE("every benchmark that is built begins with a name that its program has declared") {
  const std::string folder = std::string(RINGFENCE_BUILD) + "/bench";
  if (!std::filesystem::exists(folder + "/programs")) return;  // configured without benchmarks
  const test::ProgramResult undeclared = test::run_shell(
      "while read -r kind program names; do [ \"$kind\" = program ] || continue; "
      "for file in " +
      folder +
      "/*/$program; do [ -x \"$file\" ] || continue; "
      "\"$file\" --benchmark_list_tests=true | while read -r test; do declared=no; "
      "for name in $names; do case $test in \"$name\"*) declared=yes;; esac; done; "
      "[ $declared = yes ] || echo \"$program: $test\"; done; done; done < " +
      folder + "/programs");
  CHECK(undeclared.code == 0);
  CHECK(undeclared.out == "");
}

}  // namespace ringfence
