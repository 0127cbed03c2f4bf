#include "dds/description.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "dds/piece_assembler.hpp"
#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
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

using dds::AssignmentRecord;
using dds::WorldTermsRecord;

template <class Record>
std::span<const std::byte> bytes_of(const Record& record) {
  return std::as_bytes(std::span(&record, 1));
}
std::vector<std::byte> copy_of(std::span<const std::byte> bytes) { return {bytes.begin(), bytes.end()}; }

/// The message of the Error that `decode` throws; empty if it throws none.
template <class Decode>
std::string reason(Decode decode) {
  try {
    decode();
    return {};
  } catch (const Error& error) {
    return error.what();
  }
}

WorldTermsRecord some_terms() {
  WorldTermsRecord record;
  std::fill_n(record.bounds_max, 3, 10.0);
  record.cells_log2[0] = record.cells_log2[1] = 2;
  record.cells_log2[2] = 1;
  record.lease_ms = 100;
  record.max_objects = 1000;
  return record;
}

AssignmentRecord some_assignment() {
  AssignmentRecord assignment;
  assignment.count = 3;
  assignment.number = 1;
  assignment.objects = assignment.pairs = 64;
  assignment.map_nodes = 3;
  assignment.map_words = 32;
  return assignment;
}

std::vector<dds::PeerRecord> some_peers() { return {{7, {0x7f000001, 7525}}, {}, {9, {0x7f000001, 7526}}}; }

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

TEST_CASE("terms, assignments and region maps with invalid numbers are refused, and the message names the number") {
  const auto terms = [](void (*change)(WorldTermsRecord&)) {
    WorldTermsRecord record = some_terms();
    change(record);
    return reason([&] { dds::unpack_terms(bytes_of(record)); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(terms([](auto&) {}).empty());
  CHECK(terms([](auto& record) { record.bounds_max[2] = 1.0 / 0.0; }).find("bounds") != std::string::npos);
  CHECK(terms([](auto& record) { record.bounds_min[0] = 20; }).find("min <= max") != std::string::npos);
  CHECK(terms([](auto& record) { record.cells_log2[1] = 11; }).find("expected at most 2^10") != std::string::npos);
  CHECK(terms([](auto& record) { record.lease_ms = 1e300; }).find("a lease") != std::string::npos);
  CHECK(terms([](auto& record) { record.sense = -1; }).find("a sense of") != std::string::npos);
  CHECK(terms([](auto& record) { record.placement = 2; }).find("placement 2") != std::string::npos);
  CHECK(terms([](auto& record) { record.state_bytes = 1u << 31; }).find("model state") != std::string::npos);
  CHECK(terms([](auto& record) { record.setup_bytes = ~std::uint64_t{0}; }).find("a setup of") != std::string::npos);
  CHECK(terms([](auto& record) { record.hosts = 2; }).find("a flag is 2") != std::string::npos);
  CHECK(terms([](auto& record) { record.max_objects = 0; }).find("0 objects at most") != std::string::npos);
  WorldTermsRecord record = some_terms();
  record.lease_ms = nan;
  CHECK(reason([&] { dds::unpack_terms(bytes_of(record)); }).find("a lease of nan") != std::string::npos);

  const auto assignment = [](void (*change)(AssignmentRecord&)) {
    AssignmentRecord changed = some_assignment();
    change(changed);
    return reason([&] { dds::unpack_assignment(dds::pack_assignment(changed, some_peers()), some_terms()); });
  };
  CHECK(assignment([](auto&) {}).empty());
  CHECK(assignment([](auto& changed) { changed.number = 3; }).find("number 3 of 3 nodes") != std::string::npos);
  CHECK(assignment([](auto& changed) { changed.count = 0; }).find("0 nodes; expected 1 to") != std::string::npos);
  CHECK(assignment([](auto& changed) { changed.count = ~0u; }).find("nodes; expected 1 to") != std::string::npos);
  CHECK(assignment([](auto& changed) { changed.objects = ~std::uint64_t{0}; }).find("to reserve") != std::string::npos);
  CHECK(assignment([](auto& changed) { changed.map_nodes = 0; }).find("a map of 0 nodes") != std::string::npos);
  CHECK(assignment([](auto& changed) { changed.map_words = 31; }).find("31 entries for 32 cells") != std::string::npos);

  const auto peers = [](void (*change)(std::vector<dds::PeerRecord>&)) {
    std::vector<dds::PeerRecord> changed = some_peers();
    change(changed);
    return reason([&] { dds::unpack_assignment(dds::pack_assignment(some_assignment(), changed), some_terms()); });
  };
  CHECK(peers([](auto&) {}).empty());
  CHECK(peers([](auto& changed) { changed.pop_back(); }).find("32 bytes of peers; expected 3") != std::string::npos);
  CHECK(peers([](auto& changed) { changed[0].address.port = 65536; }).find("port is 65536") != std::string::npos);
  CHECK(peers([](auto& changed) { changed[0].address.host = 0; }).find("an incarnation or an") != std::string::npos);
  CHECK(peers([](auto& changed) { changed[1] = changed[0]; }).find("its own peer") != std::string::npos);

  const auto map = [](std::vector<std::uint32_t> table) {
    AssignmentRecord assigned = some_assignment();
    assigned.map_words = static_cast<std::uint32_t>(table.size());
    return reason([&] { dds::unpack_regions(std::as_bytes(std::span(table)), some_terms(), assigned); });
  };
  constexpr const char* not_owned = "not every cell, or part of one, is owned by one of 3 nodes";
  std::vector<std::uint32_t> table(32, 2);
  CHECK(map(table).empty());
  table[7] = 3;
  CHECK(map(table).find(not_owned) != std::string::npos);
  table[7] = regions::RegionMap::cut_entry(0, 0);
  CHECK(map(table).find(not_owned) != std::string::npos);                   // there is no such cut
  constexpr std::uint32_t corner = 3u << 30, middle = corner + (1u << 29);  // of cell 7 on the x axis
  table.insert(table.end(), {middle, 0, 1});
  CHECK(map(table).empty());
  for (const std::uint32_t outside : {0u, corner - 1, corner}) {  // planes that do not cut the cell
    table[32] = outside;
    CHECK(map(table).find(not_owned) != std::string::npos);
  }
  table[32] = middle;
  table[8] = regions::RegionMap::cut_entry(1, 0);  // two cells have the same halves
  CHECK(map(table).find(not_owned) != std::string::npos);
  table[8] = 2;
  table[34] = regions::RegionMap::cut_entry(2, 0);  // the cut is a part of itself
  CHECK(map(table).find(not_owned) != std::string::npos);
  table[34] = 1;
  table[7] = regions::RegionMap::cut_entry(3, 0);  // an invalid axis
  CHECK(map(table).find(not_owned) != std::string::npos);
  table[7] = regions::RegionMap::cut_entry(0, 0);
  table[33] = regions::RegionMap::cut_entry(0, 1);  // a plane that is already a side of the part
  table.insert(table.end(), {middle, 0, 1});
  CHECK(map(table).find(not_owned) != std::string::npos);
  for (const std::uint32_t depth : {96u, 97u}) {  // each part one step narrower than the one before
    std::vector<std::uint32_t> chain(32, 2);
    chain[7] = regions::RegionMap::cut_entry(0, 0);
    for (std::uint32_t cut = 0; cut < depth; ++cut) {
      chain.insert(chain.end(), {corner + 1 + cut, 0, cut + 1 < depth ? regions::RegionMap::cut_entry(0, cut + 1) : 1});
    }
    CHECK(map(chain).empty() == (depth == 96));
  }
}

TEST_CASE("terms, an assignment, a map or a shape with any changed byte is refused or valid") {
  const auto mutate = [](std::vector<std::byte> bytes, auto decode) {
    for (std::size_t at = 0; at < bytes.size(); ++at) {
      const std::byte old = bytes[at];
      for (const unsigned mask : {1u, 2u, 4u, 8u, 16u, 32u, 64u, 128u, 255u}) {
        bytes[at] = old ^ static_cast<std::byte>(mask);
        reason([&] { decode(bytes); });
      }
      bytes[at] = old;
    }
  };
  mutate(copy_of(bytes_of(some_terms())), [](std::span<const std::byte> bytes) {
    const WorldTermsRecord terms = dds::unpack_terms(bytes);
    const geometry::FixedSpace space({terms.bounds_min[0], terms.bounds_min[1], terms.bounds_min[2]},
                                     {terms.bounds_max[0], terms.bounds_max[1], terms.bounds_max[2]});
    CHECK(dds::grid_of(terms).cells() <= std::size_t{1} << 30);
  });
  mutate(dds::pack_assignment(some_assignment(), some_peers()), [](std::span<const std::byte> bytes) {
    const dds::Assignment assignment = dds::unpack_assignment(bytes, some_terms());
    CHECK(assignment.record.number < assignment.record.count);
    CHECK(assignment.peers.size() == assignment.record.count);
  });
  std::vector<std::uint32_t> table(32, 1);
  table[5] = regions::RegionMap::cut_entry(1, 0);
  table.insert(table.end(), {3u << 29, 0, 2});
  AssignmentRecord assignment = some_assignment();
  assignment.map_words = static_cast<std::uint32_t>(table.size());
  mutate(copy_of(std::as_bytes(std::span(table))), [&](std::span<const std::byte> bytes) {
    const regions::RegionMap map = dds::unpack_regions(bytes, some_terms(), assignment);
    const std::uint32_t points[][3] = {{0, 0, 0}, {~0u, ~0u, ~0u}, {1u << 30, 1u << 31, 5}};
    for (const auto& point : points) {
      CHECK(map.owner_at(point) < 3);
    }
    std::size_t visits = 0;
    map.visit_owners({{0, 0, 0}, {~0u, ~0u, ~0u}}, [&](NodeNumber node) { return ++visits, node < 3; });
    CHECK(visits >= 32);
  });
  for (const ShapeDescription& shape : some_shapes()) {
    mutate(pack_shape(shape), [](std::span<const std::byte> bytes) {
      geometry::ShapeTable shapes;
      shapes.add(unpack_shape(bytes, 0, nullptr));
    });
  }
}

TEST_CASE("a piece that no World sends is refused") {
  const auto add = [](std::uint32_t kind, std::uint32_t number, std::uint32_t part, std::uint32_t parts,
                      std::size_t size) {
    const std::vector<std::byte> content(size);
    dds::PieceSample piece{};
    piece.kind = kind;
    piece.number = number;
    piece.part = part;
    piece.parts = parts;
    piece.bytes = dds::borrow(content);
    dds::PieceAssembler assembler;
    return reason([&] { assembler.add(piece); });
  };
  CHECK(add(0, 0, 0, 1, 10).empty());
  CHECK(!add(3, 0, 0, 1, 10).empty());
  CHECK(!add(0, 0xffffffffu, 0, 1, 10).empty());
  CHECK(!add(0, 0, 0, 0, 10).empty());
  CHECK(!add(0, 0, 1, 1, 10).empty());
  CHECK(!add(0, 0, 0, 0xffffffffu, 10).empty());
  CHECK(!add(0, 0, 0, 1, 50'000).empty());
}

TEST_CASE("a support function is not sent: the node supplies its own, or the World is refused") {
  struct Point : SupportFunction {
    Vec3f support(Vec3f) const override { return {1, 2, 3}; }
  };
  const auto function = std::make_shared<Point>();
  const auto bytes = pack_shape(SupportShape{function});
  CHECK(fails(bytes));
  const ShapeDescription shape = unpack_shape(bytes, 3, [&](ShapeId number) {
    CHECK(number == ShapeId(3));
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
