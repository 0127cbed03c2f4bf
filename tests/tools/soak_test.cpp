#include <string>

#include <doctest/doctest.h>

#include "tools/program.hpp"

namespace ringfence {

TEST_CASE("in a short soak objects, user nodes and CD nodes come, go and fail, and all holds") {
  for (const char* deployment : {"user", "user-server", "user-collision"}) {
    CAPTURE(deployment);
    const test::ProgramResult answer = test::ringfence(
        std::string("run --soak 0.03 --objects 300 --users 10 --nodes 3 --check --node-deadline-ms 60 --deployment ") +
        deployment);
    REQUIRE_MESSAGE(answer.code == 0, answer.out);
    CHECK(answer.out.find("all held") != std::string::npos);
    CHECK(answer.out.find(" 0 differences") != std::string::npos);
    CHECK(answer.out.find(" 0 resizes") == std::string::npos);
  }
}

TEST_CASE("a soak refuses what does not go with it") {
  CHECK(test::ringfence("run --soak 0.01 --json out.json").code == 2);
  CHECK(test::ringfence("run --soak -1").code == 2);
}

}  // namespace ringfence
