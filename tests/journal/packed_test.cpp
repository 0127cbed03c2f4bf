#include "journal/packed.hpp"

#include <cstddef>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::journal {
namespace {

TEST_CASE("bytes come back, and only with the key, size and checksum that belong to them") {
  std::mt19937 random(1);
  for (const std::size_t size : {0u, 1u, 100u, 70'000u}) {
    CAPTURE(size);
    std::vector<std::byte> bytes(size), back;
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 5);
    Packed packed = pack(7, bytes);
    CHECK((size < 1000 || packed.bytes.size() < size / 2));
    REQUIRE(unpack(7, packed.size, packed.checksum, packed.bytes, back));
    CHECK(back == bytes);
    CHECK(!unpack(8, packed.size, packed.checksum, packed.bytes, back));
    CHECK(!unpack(7, packed.size + 1, packed.checksum, packed.bytes, back));
    CHECK(!unpack(7, packed.size, packed.checksum ^ 1, packed.bytes, back));
    for (std::size_t i = 0; i < packed.bytes.size(); i += 1 + packed.bytes.size() / 50) {
      packed.bytes[i] ^= std::byte{16};
      CHECK(!unpack(7, packed.size, packed.checksum, packed.bytes, back));
      packed.bytes[i] ^= std::byte{16};
    }
  }
}

TEST_CASE("a wrong size with a right checksum is refused without allocating it") {
  const Packed packed = pack(1, std::vector<std::byte>(50));
  std::vector<std::byte> back;
  for (const std::uint64_t size : {std::uint64_t{49}, std::uint64_t{1} << 35, ~std::uint64_t{0}}) {
    CHECK(!unpack(1, size, checksum_of(1, size, packed.bytes), packed.bytes, back));
  }
}

}  // namespace
}  // namespace ringfence::journal
