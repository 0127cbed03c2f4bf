#include "base/stream_lines.hpp"

#include <array>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::base {
namespace {

struct alignas(64) Line {
  std::array<std::uint32_t, 16> words{};
};
struct alignas(64) TwoLines {
  Line lines[2];
};

TEST_CASE("lines that are copied past the caches are those of the source, and no others are written") {
  for (std::uint32_t count = 0; count < 20; ++count) {
    std::vector<Line> from(count), to(count + 2);
    for (std::uint32_t i = 0; i < count; ++i) from[i].words.fill(i + 1);
    stream_lines(std::span<const Line>(from), to.data() + 1);
    finish_streams();
    CHECK(to.front().words == Line().words);
    CHECK(to.back().words == Line().words);
    for (std::uint32_t i = 0; i < count; ++i) CHECK(to[i + 1].words == from[i].words);
  }
}

TEST_CASE("elements of several lines are copied whole") {
  TwoLines from, to;
  from.lines[1].words.fill(7);
  stream_lines(std::span<const TwoLines>(&from, 1), &to);
  finish_streams();
  CHECK(to.lines[0].words == from.lines[0].words);
  CHECK(to.lines[1].words == from.lines[1].words);
}

}  // namespace
}  // namespace ringfence::base
