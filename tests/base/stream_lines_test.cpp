#include "base/stream_lines.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
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

TEST_CASE("bytes of any length and position are copied, and no others are written") {
  constexpr std::byte untouched{0xaa};
  std::vector<std::byte> from(400);
  for (std::size_t i = 0; i < from.size(); ++i) from[i] = std::byte(i * 7 % 251 + 1);
  for (std::size_t begin = 0; begin < 130; begin += 3) {
    for (std::size_t bytes = 0; bytes < 260; bytes += 1 + bytes / 40) {
      alignas(64) std::array<std::byte, 512> to;
      to.fill(untouched);
      stream_bytes(to.data() + begin, from.data() + begin % 17, bytes);
      finish_streams();
      const auto first = to.begin() + static_cast<std::ptrdiff_t>(begin);
      const auto last = first + static_cast<std::ptrdiff_t>(bytes);
      REQUIRE(std::equal(first, last, from.begin() + static_cast<std::ptrdiff_t>(begin % 17)));
      REQUIRE(std::all_of(to.begin(), first, [](std::byte b) { return b == untouched; }));
      REQUIRE(std::all_of(last, to.end(), [](std::byte b) { return b == untouched; }));
    }
  }
}

}  // namespace
}  // namespace ringfence::base
