#include "machine.hpp"

#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>
#include <sched.h>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

/// Restricts the calling thread, and the processes that it starts, to one of its CPUs.
class OneCpu {
 public:
  OneCpu() {
    sched_getaffinity(0, sizeof before_, &before_);
    cpu_set_t one;
    CPU_ZERO(&one);
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
      if (CPU_ISSET(cpu, &before_)) {
        CPU_SET(cpu, &one);
        break;
      }
    }
    sched_setaffinity(0, sizeof one, &one);
  }
  ~OneCpu() { sched_setaffinity(0, sizeof before_, &before_); }
  OneCpu(const OneCpu&) = delete;
  OneCpu& operator=(const OneCpu&) = delete;
  int cpus_before() const { return CPU_COUNT(&before_); }

 private:
  cpu_set_t before_;
};

}  // namespace

TEST_CASE("usable cores are those that the CPU affinity allows") {
  const OneCpu one;
  CHECK(tools::usable_cores() == 1);
  CHECK(tools::this_machine().usable_cores == 1);
  CHECK(tools::this_machine().cores >= static_cast<unsigned>(one.cpus_before()));
}

TEST_CASE("scale compares wall and modelled times only where the CPU affinity leaves a core for each thread") {
  const test::TemporaryFolder folder;
  const std::string arguments =
      "scale --objects 120 --users 10 --frames 3 --warmup 1 --repeats 1 --nodes 0,1 --deployment user --json " +
      (folder / "s.json");
  const auto report_with = [&] {
    const test::ProgramResult result = test::ringfence(arguments);
    REQUIRE_MESSAGE(result.code == 0, result.out);
    return nlohmann::json::parse(worlds::read_text(folder / "s.json"));
  };
  const bool two_cores = tools::usable_cores() >= 2;
  CHECK(report_with()["runs"][1]["cores_suffice"] == two_cores);
  const OneCpu one;
  const auto restricted = report_with();
  CHECK(restricted["machine"]["usable_cores"] == 1);
  CHECK(restricted["runs"][0]["cores_suffice"] == true);
  CHECK(restricted["runs"][1]["cores_suffice"] == false);
  if (two_cores)
    CHECK(test::ringfence(arguments).out.find(" cores, 1 of them usable (CPU affinity), ") != std::string::npos);
}

TEST_CASE("the default number of CD nodes honours the CPU affinity") {
  const OneCpu one;
  const test::ProgramResult result = test::ringfence("run --objects 200 --users 5 --frames 2 --warmup 0");
  CHECK(result.out.find("user-collision, 1 CD node, ") != std::string::npos);
}

}  // namespace ringfence
