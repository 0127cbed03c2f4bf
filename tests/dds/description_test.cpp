#include "dds/description.hpp"

#include <cstring>
#include <random>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "dds/piece_assembler.hpp"
#include "ringfence/error.hpp"

namespace ringfence {
namespace {

using dds::pack_shape;
using dds::unpack_shape;

std::vector<ShapeDescription> some_shapes() {
  TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 1, 2, 0, 2, 3}};
  return {Sphere{1.5f}, Box{{1, 2, 3}}, Capsule{0.5f, 2}, ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
          std::move(mesh)};
}

bool fails(std::span<const std::byte> bytes) {
  try {
    unpack_shape(bytes, 3, nullptr);
    return false;
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

TEST_CASE("a shape that is packed, unpacked and packed again has the same bytes") {
  for (const ShapeDescription& shape : some_shapes()) {
    const auto bytes = pack_shape(shape);
    const ShapeDescription again = unpack_shape(bytes, 0, nullptr);
    CHECK(again.index() == shape.index());
    CHECK(pack_shape(again) == bytes);
  }
}

TEST_CASE("bytes that are not a shape are refused") {
  std::mt19937_64 random(5);
  for (const ShapeDescription& shape : some_shapes()) {
    const auto bytes = pack_shape(shape);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      CHECK(fails(std::span(bytes).first(size)));
    }
    auto longer = bytes;
    longer.push_back(std::byte{0});
    CHECK(fails(longer));
  }
  for (int turn = 0; turn < 20'000; ++turn) {
    std::vector<std::byte> bytes(8 + random() % 100);
    for (std::byte& byte : bytes) {
      byte = static_cast<std::byte>(random());
    }
    const std::uint64_t kind = random() % 8;
    std::memcpy(bytes.data(), &kind, sizeof kind);
    fails(bytes);  // may fail or not, but must not read past the end
  }
}

TEST_CASE("a support function is not sent: the node supplies its own, or the World is refused") {
  struct Point : SupportFunction {
    Vec3f support(Vec3f) const override { return {1, 2, 3}; }
  };
  const auto function = std::make_shared<Point>();
  const auto bytes = pack_shape(SupportShape{function});
  CHECK(fails(bytes));
  const ShapeDescription shape = unpack_shape(bytes, 3, [&](ShapeNumber number) {
    CHECK(number == 3);
    return function;
  });
  CHECK(std::get<SupportShape>(shape).function == function);
}

TEST_CASE("pieces are reassembled in any order, and only those of one epoch") {
  std::vector<std::byte> content(100);
  for (std::size_t i = 0; i < content.size(); ++i) {
    content[i] = static_cast<std::byte>(i);
  }
  const auto piece = [&](std::uint32_t part, std::uint32_t epoch) {
    dds::PieceSample sample{};
    sample.kind = static_cast<std::uint32_t>(dds::PieceKind::regions);
    sample.part = part;
    sample.parts = 4;
    sample.epoch = epoch;
    sample.bytes = dds::borrow(std::span(content).subspan(part * 25, 25));
    return sample;
  };
  dds::PieceAssembler assembler;
  for (const std::uint32_t part : {2u, 0u, 3u}) {
    assembler.add(piece(part, 7));
  }
  CHECK(assembler.find(dds::PieceKind::regions, 0, 7) == nullptr);
  assembler.add(piece(1, 8));  // a piece of another epoch discards the earlier ones
  CHECK(assembler.find(dds::PieceKind::regions, 0, 7) == nullptr);
  for (const std::uint32_t part : {3u, 2u, 0u}) {
    assembler.add(piece(part, 8));
  }
  REQUIRE(assembler.find(dds::PieceKind::regions, 0, 8) != nullptr);
  CHECK(*assembler.find(dds::PieceKind::regions, 0, 8) == content);
  CHECK(assembler.find(dds::PieceKind::shape, 0, 8) == nullptr);
}

}  // namespace ringfence
