#include "motion/random.hpp"

#include <set>

#include <doctest/doctest.h>

namespace ringfence::motion {

TEST_CASE("philox returns the published values") {
  // Known answers of the Random123 distribution for philox4x32-10.
  using Words = std::array<std::uint32_t, 4>;
  CHECK(philox({0, 0, 0, 0}, 0) == Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  CHECK(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, 0xffffffffffffffffu) ==
        Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  CHECK(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, 0x299f31d0a4093822u) ==
        Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("uniform floats lie in [0, 1) at both ends of the range") {
  CHECK(uniform(0) == 0.0f);
  CHECK(uniform(0xffffffffu) == 1.0f - 0x1p-24f);
}

TEST_CASE("draws below a count have a uniform distribution") {
  std::array<int, 7> seen{};
  Draws draws(3, 1, 2);
  for (int i = 0; i < 70'000; ++i) ++seen[uniform_below(7, draws.word())];
  for (const int count : seen) {
    CHECK(count > 9500);
    CHECK(count < 10'500);
  }
}

TEST_CASE("draws differ between seeds, streams, subjects and epochs, and repeat for equal ones") {
  std::set<std::uint32_t> first;
  first.insert(Draws(1, 1, 1, 1).word());
  first.insert(Draws(2, 1, 1, 1).word());
  first.insert(Draws(std::uint64_t{1} << 32 | 1, 1, 1, 1).word());
  first.insert(Draws(1, 2, 1, 1).word());
  first.insert(Draws(1, 1, 2, 1).word());
  first.insert(Draws(1, 1, 1, 2).word());
  CHECK(first.size() == 6);
  CHECK(first.contains(Draws(1, 1, 1, 1).word()));

  Draws sequence(5, 6, 7, 8);
  std::set<std::uint32_t> words;
  for (int i = 0; i < 64; ++i) words.insert(sequence.word());
  CHECK(words.size() == 64);
}

}  // namespace ringfence::motion
