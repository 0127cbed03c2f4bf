// Runs benchmarks of small worlds, once each: those that fail or do not end would not be noticed otherwise.
#include <filesystem>
#include <fstream>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "tools/program.hpp"

namespace ringfence {
namespace {

struct Selection {
  const char* program;
  const char* filter;
};

constexpr Selection selections[] = {
    {"bench_broad_phase", "/(cluster|spot)/4000/"},
    {"bench_dds", "/(1|4)/"},
    {"bench_facade", "^(frame/(mixed|hull)|frame_drift/mixed)/4000/"},
    {"bench_limits", "/(1000|4000)/(bounds|real_time|never)"},
    {"bench_link", "^(ring/(msg64|mixed|roundtrip)/|frame/(empty/2/|messages/4000/))"},
    {"bench_narrow_phase", "/(sphere_box|hull8_hull8|crate_crate|sphere_mesh)/"},
    {"bench_nodes", "/40$"},
    {"bench_queries", "/(rays|sweeps|overlaps|nearest)/4000/"},
};

const char* filter_of(const std::string& program) {
  for (const Selection& selection : selections) {
    if (program == selection.program) return selection.filter;
  }
  return nullptr;
}

/// The path of a benchmark program; empty if it is not built.
std::string file_of(const std::string& program) {
  for (const auto& folder : std::filesystem::directory_iterator(RINGFENCE_BUILD "/bench")) {
    if (std::filesystem::is_regular_file(folder.path() / program)) return (folder.path() / program).string();
  }
  return {};
}

void check_run(const std::string& file, const std::string& filter) {
  const test::TemporaryFolder folder;
  const std::string json = folder / "out.json";
  const test::ProgramResult result =
      test::run_shell("timeout 120 '" + file + "' '--benchmark_filter=" + filter +
                      "' --benchmark_min_time=0.001 --benchmark_out_format=json '--benchmark_out=" + json + "' 2>&1");
  REQUIRE_MESSAGE(result.code == 0, result.out);
  const nlohmann::json runs = nlohmann::json::parse(std::ifstream(json)).at("benchmarks");
  CHECK(!runs.empty());
  for (const nlohmann::json& run : runs) {
    const std::string name = run.at("name");
    CAPTURE(name);
    CHECK_MESSAGE(!run.value("error_occurred", false), run.value("error_message", ""));
    CHECK(run.value("real_time", 0.0) > 0);
    // Peers may find other contacts, for example Bullet, which has margins around shapes.
    if (name.find("/ringfence") != std::string::npos) CHECK(run.value("differ", 0.0) == 0);
  }
}

}  // namespace

TEST_CASE("small benchmarks of each program run without an error") {
  std::ifstream programs(RINGFENCE_BUILD "/bench/programs");
  if (!programs) return;  // configured without benchmarks
  for (std::string kind, program, rest; programs >> kind >> program && std::getline(programs, rest);) {
    const std::string file = file_of(program);
    if (kind != "program" || file.empty()) continue;
    CAPTURE(program);
    const char* const filter = filter_of(program);
    REQUIRE_MESSAGE(filter != nullptr, "add a filter for its small benchmarks to `selections`");
    check_run(file, filter);
  }
}

}  // namespace ringfence
