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
    CHECK(result.out.find(" 0 resizes") == std::string::npos);
  }
}

TEST_CASE("--soak refuses options that do not apply to a soak") {
  CHECK(test::ringfence("run --soak 0.01 --json out.json").code == 2);
  CHECK(test::ringfence("run --soak -1").code == 2);
}

}  // namespace ringfence
