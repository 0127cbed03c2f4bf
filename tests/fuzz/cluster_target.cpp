// Property: any bytes as data from another process of a cluster are either refused, with an Error or a status, or all
// their numbers are valid. The first byte selects the kind of data. No network is used.
#include <algorithm>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "dds/announcement.hpp"
#include "dds/description.hpp"
#include "dds/node_session.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/peer_links.hpp"
#include "dds/piece_assembler.hpp"
#include "dds/release.hpp"
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
  if (!bytes.empty()) std::memcpy(numbers, bytes.data(), std::min(bytes.size(), sizeof numbers));
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

void read_messages(Bytes bytes) {
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

/// The byte at the front, which is removed; 0 at the end.
std::uint8_t take_byte(Bytes& bytes) {
  if (bytes.empty()) return 0;
  const auto first = std::to_integer<std::uint8_t>(bytes.front());
  bytes = bytes.subspan(1);
  return first;
}

template <class Value>
Value take(Bytes& bytes) {
  Value value{};
  const std::size_t size = std::min(bytes.size(), sizeof value);
  if (size != 0) std::memcpy(&value, bytes.data(), size);
  bytes = bytes.subspan(size);
  return value;
}

void read_presence(Bytes bytes) {
  dds::PresenceSample sample{};
  sample.version = dds::wire_version;
  dds::write_byte_order(sample.order);
  sample.state = take<std::uint32_t>(bytes);
  sample.layout = take_byte(bytes) % 2 == 0 ? dds::fingerprint() : take<std::uint64_t>(bytes);
  std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  sample.name = text.data();
  sample.reason = text.empty() ? nullptr : text.data() + text.size() / 2;
  const dds::Announcement announced = dds::read_announcement(sample);
  require(announced.fits == (sample.layout == dds::fingerprint()));
  require(announced.state <= dds::NodeState::refused);
  for (const std::string& shown : {announced.name, announced.reason}) {
    require(shown.size() <= dds::max_foreign_text);
    require(std::none_of(shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }));
  }
}

/// A sequence of pieces, as they arrive at a node: the shapes are known in the order of their numbers, without a gap.
void read_pieces(Bytes bytes) {
  dds::WorldTermsRecord terms = some_terms();
  terms.bounds_max[0] = terms.bounds_max[1] = terms.bounds_max[2] = 1;
  terms.setup_bytes = take_byte(bytes) % 4;
  const dds::NodeServiceConfig config;
  dds::JoinedWorld world(1, terms, config);
  std::map<std::uint32_t, bool> delivered;  // shapes of which at least one part has arrived
  while (!bytes.empty()) {
    dds::PieceSample piece{};
    piece.kind = take_byte(bytes) % 4;
    piece.number = take_byte(bytes) % 4;
    piece.parts = take_byte(bytes) % 4;
    piece.part = take_byte(bytes) % 4;
    piece.epoch = take_byte(bytes) % 3;
    const std::size_t length = take_byte(bytes);
    const Bytes contents = bytes.first(std::min(bytes.size(), length));
    piece.bytes = dds::borrow(contents);
    bytes = bytes.subspan(contents.size());
    world.add(piece);
    if (piece.kind == static_cast<std::uint32_t>(dds::PieceKind::shape)) delivered[piece.number] = true;
    require(world.shapes().size() <= delivered.size());
    require(world.is_ready() || terms.setup_bytes != 0);
  }
  for (std::uint32_t number = 0; number < world.shapes().size(); ++number) {
    require(delivered.count(number) == 1);
  }
}

/// A stream of parcels, as it arrives at a link: the channel delivers those of an independent parser, and breaks at the
/// first header that is not valid.
void read_stream(Bytes bytes) {
  std::vector<std::vector<std::byte>> expected;
  for (Bytes rest = bytes; rest.size() >= sizeof(dds::ParcelHeader);) {
    const auto header = take<dds::ParcelHeader>(rest);
    if (header.bytes % 8 != 0 || header.bytes > dds::ParcelChannel::max_bytes || header.bytes > rest.size()) break;
    expected.emplace_back(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(header.bytes));
    rest = rest.subspan(header.bytes);
  }
  dds::ParcelChannel channel(dds::LinkStream(dds::LinkSocket(), bytes));
  std::vector<std::vector<std::byte>> received;
  bool waits = true;  // every parcel is offered twice: the first time nothing of it is taken
  const auto deliver = [&](dds::ParcelKind, std::uint32_t, std::size_t&, Bytes contents) {
    waits = !waits;
    if (!waits) return false;
    received.emplace_back(contents.begin(), contents.end());
    return true;
  };
  for (std::size_t i = 0; i <= expected.size(); ++i) channel.receive(deliver);
  require(received == expected);
  require(channel.is_broken());
}

/// Messages on the link between two nodes.
void read_link(Bytes bytes) {
  bool is_valid = true;
  for (Bytes rest = bytes; is_valid;) {
    const Bytes message = dds::PeerLinks::first_message(rest, is_valid);
    require(is_valid || message.empty());
    if (message.empty()) break;
    require(message.size() <= dds::ParcelChannel::largest_message);
    const std::size_t taken = sizeof(dds::Packing) + (message.size() + 7) / 8 * 8;
    require(taken <= rest.size() && message.data() == rest.data() + sizeof(dds::Packing));
    rest = rest.subspan(taken);
  }
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
  constexpr void (*reads[])(fuzz::Bytes) = {
      fuzz::read_terms,    fuzz::read_assignment, fuzz::read_regions, fuzz::read_shape,  fuzz::read_piece,
      fuzz::read_messages, fuzz::read_presence,   fuzz::read_pieces,  fuzz::read_stream, fuzz::read_link};
  try {
    reads[input[0] % std::size(reads)](bytes);
  } catch (const Error&) {
    return 0;  // refused
  }
  return 0;
}
