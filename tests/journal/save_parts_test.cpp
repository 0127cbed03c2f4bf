#include "journal/save_parts.hpp"

#include <cstring>
#include <random>

#include <doctest/doctest.h>

namespace ringfence::journal {
namespace {

std::vector<std::byte> random_bytes(std::mt19937& random, std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

TEST_CASE("a save is its pieces in order, and long writes are parts that are named by their content") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  for (int round = 0; round < 50; ++round) {
    std::vector<std::vector<std::byte>> writes(random() % 8);
    std::vector<std::byte> all;
    std::size_t parts = 0;
    PartsSink sink;
    for (auto& write : writes) {
      write = random_bytes(random, random() % (2 * least_part));
      all.insert(all.end(), write.begin(), write.end());
      parts += write.size() >= least_part ? 1 : 0;
      REQUIRE(sink.write(write));
    }
    const SaveInParts save = sink.take();
    CHECK(save.bytes == all);
    REQUIRE(save.parts.size() == parts);
    Recipe recipe;
    REQUIRE(read_recipe(write_recipe(recipe_of(save)), recipe));
    std::size_t at = 0, in_recipe = 0;
    for (const Piece& piece : recipe.pieces) {
      REQUIRE(piece.size <= all.size() - at);
      const auto content = std::span(all).subspan(at, piece.size);
      if (piece.is_part != 0) {
        CHECK(piece.part == name_of_part(content));
      } else {
        REQUIRE(std::memcmp(recipe.bytes.data() + in_recipe, content.data(), piece.size) == 0);
        in_recipe += piece.size;
      }
      at += piece.size;
    }
    CHECK(at == all.size());
    CHECK(in_recipe == recipe.bytes.size());
  }
}

TEST_CASE("parts of the same bytes have one name, and any other byte gives another name") {
  std::mt19937 random(5);
  std::vector<std::byte> part = random_bytes(random, 5000);
  const PartName name = name_of_part(part);
  CHECK(name_of_part(std::vector<std::byte>(part)) == name);
  for (std::size_t i = 0; i < part.size(); i += 97) {
    part[i] ^= std::byte{1};
    CHECK(name_of_part(part) != name);
    part[i] ^= std::byte{1};
  }
}

TEST_CASE("bytes that are not exactly one recipe are refused") {
  std::mt19937 random(6);
  PartsSink sink;
  for (const std::size_t size : {100u, 5000u, 300u}) REQUIRE(sink.write(random_bytes(random, size)));
  const std::vector<std::byte> good = write_recipe(recipe_of(sink.take()));
  Recipe recipe;
  REQUIRE(read_recipe(good, recipe));
  CHECK(recipe.pieces.size() == 3);
  for (std::size_t size = 0; size < good.size(); ++size) CHECK(!read_recipe(std::span(good).first(size), recipe));
  std::vector<std::byte> bad = good;
  bad.push_back(std::byte{0});
  CHECK(!read_recipe(bad, recipe));
  for (const std::uint64_t count : {std::uint64_t{4}, std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
    bad = good;
    std::memcpy(bad.data(), &count, sizeof count);
    CHECK(!read_recipe(bad, recipe));
  }
  for (const std::uint64_t size : {std::uint64_t{99}, std::uint64_t{101}, ~std::uint64_t{0}}) {
    bad = good;
    std::memcpy(bad.data() + sizeof(std::uint64_t), &size, sizeof size);  // of the first piece
    CHECK(!read_recipe(bad, recipe));
  }
}

}  // namespace
}  // namespace ringfence::journal
