// Property: any bytes as data from another process of a cluster are either refused, with an Error or a status, or all
// their numbers are valid. The first byte selects the kind of data. No network is used.
#include <cstring>
#include <span>
#include <vector>

#include "dds/description.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/piece_assembler.hpp"
#include "fuzz/target.hpp"
#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "messages/header.hpp"
#include "nodes/message_check.hpp"
#include "ringfence/error.hpp"

namespace ringfence::fuzz {
namespace {

using Bytes = std::span<const std::byte>;

dds::WorldTermsRecord some_terms() {
  dds::WorldTermsRecord terms;
  terms.cells_log2[0] = terms.cells_log2[1] = 1;
  return terms;
}

void read_terms(Bytes bytes) {
  const dds::WorldTermsRecord terms = dds::unpack_terms(bytes);
  const geometry::FixedSpace space({terms.bounds_min[0], terms.bounds_min[1], terms.bounds_min[2]},
                                   {terms.bounds_max[0], terms.bounds_max[1], terms.bounds_max[2]},
                                   geometry::Outside::has_octaves);
  require(terms.lease_ms >= 10 && terms.state_bytes <= max_motion_state);
}

void read_assignment(Bytes bytes) {
  const dds::AssignmentRecord assignment = dds::unpack_assignment(bytes, some_terms()).record;
  require(assignment.number < assignment.count && assignment.count <= 1024);
}

void read_regions(Bytes bytes) {
  constexpr std::uint32_t nodes = 3;
  dds::AssignmentRecord assignment;
  assignment.map_nodes = nodes;
  assignment.map_words = static_cast<std::uint32_t>(bytes.size() / sizeof(std::uint32_t));
  const regions::RegionMap map = dds::unpack_regions(bytes, some_terms(), assignment);
  const std::uint32_t points[][3] = {{0, 0, 0}, {~0u, ~0u, ~0u}, {1u << 30, 3u << 30, 5}};
  for (const auto& point : points) {
    require(map.owner_at(point) < nodes);
  }
  map.visit_owners({{0, 0, 0}, {~0u, ~0u, ~0u}}, [&](NodeNumber node) {
    require(node < nodes);
    return true;
  });
}

void read_shape(Bytes bytes) {
  geometry::ShapeTable shapes;
  shapes.add(dds::unpack_shape(bytes, 0, nullptr));
}

void read_piece(Bytes bytes) {
  std::uint32_t numbers[5] = {};
  std::memcpy(numbers, bytes.data(), std::min(bytes.size(), sizeof numbers));
  dds::PieceSample piece{};
  piece.kind = numbers[0];
  piece.number = numbers[1];
  piece.part = numbers[2];
  piece.parts = numbers[3];
  piece.epoch = numbers[4];
  piece.bytes = dds::borrow(bytes.subspan(std::min(bytes.size(), sizeof numbers)));
  dds::PieceAssembler assembler;
  assembler.add(piece);
  const auto* complete = assembler.find(static_cast<dds::PieceKind>(piece.kind), piece.number, piece.epoch);
  require((complete != nullptr) == (piece.parts == 1));
}

void read_parcel(Bytes bytes) {
  constexpr nodes::MessageLimits limits{.nodes = 4, .shapes = 2, .slots = 64};
  std::size_t offset = 0;
  dds::for_each_message(bytes, offset, [&](Bytes message) {
    messages::MessageView view;
    if (messages::decode(message, 8, view) == Status::ok && nodes::is_valid(view, limits)) {
      for (std::size_t i = 0; view.type() == messages::MessageType::hand_over && i < view.count(); ++i) {
        require(view.record<messages::HandOverRecord>(i).object.slot < limits.slots);
      }
    }
    return true;
  });
  require(offset == bytes.size());
}

}  // namespace
}  // namespace ringfence::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  using namespace ringfence;
  if (size == 0) {
    return 0;
  }
  // An aligned copy of exactly that size, so that the address sanitizer detects a read past its end.
  const auto* const first = reinterpret_cast<const std::byte*>(input);
  const std::vector<std::byte> bytes(first + 1, first + size);
  constexpr void (*reads[])(fuzz::Bytes) = {fuzz::read_terms, fuzz::read_assignment, fuzz::read_regions,
                                            fuzz::read_shape, fuzz::read_piece,      fuzz::read_parcel};
  try {
    reads[input[0] % std::size(reads)](bytes);
  } catch (const Error&) {
    return 0;  // refused
  }
  return 0;
}
