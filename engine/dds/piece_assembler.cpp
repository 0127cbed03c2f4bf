#include "dds/piece_assembler.hpp"

#include <algorithm>
#include <string>

#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

constexpr std::size_t piece_bytes = 48'000;
constexpr std::uint32_t max_parts = (std::uint32_t{1} << 30) / piece_bytes + 1;
constexpr std::uint32_t max_shapes = std::uint32_t{1} << 24;

void check(const PieceSample& piece) {
  const bool is_known = piece.kind <= static_cast<std::uint32_t>(PieceKind::setup);
  if (!is_known || piece.number >= max_shapes || piece.parts == 0 || piece.parts > max_parts ||
      piece.part >= piece.parts || piece.bytes._length > piece_bytes) {
    throw Error("no World sends a piece of kind " + std::to_string(piece.kind) + ", number " +
                std::to_string(piece.number) + ", part " + std::to_string(piece.part) + " of " +
                std::to_string(piece.parts) + " with " + std::to_string(piece.bytes._length) + " bytes");
  }
}

}  // namespace

std::size_t piece_parts(std::size_t bytes) noexcept {
  return std::max<std::size_t>(1, (bytes + piece_bytes - 1) / piece_bytes);
}

void dispose_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t first,
                    std::uint32_t end) noexcept {
  for (std::uint32_t part = first; part < end; ++part) {
    const PieceSample piece{world, static_cast<std::uint32_t>(kind), number, part, end, 0, {}};
    dds_dispose(writer, &piece);
  }
}

bool write_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t epoch,
                  std::span<const std::byte> bytes) {
  const std::size_t parts = piece_parts(bytes.size());
  for (std::size_t part = 0; part < parts; ++part) {
    const auto slice = bytes.subspan(part * piece_bytes, std::min(piece_bytes, bytes.size() - part * piece_bytes));
    const PieceSample piece{world,
                            static_cast<std::uint32_t>(kind),
                            number,
                            static_cast<std::uint32_t>(part),
                            static_cast<std::uint32_t>(parts),
                            epoch,
                            borrow(slice)};
    // Called between frames and rarely, so it may wait for a congested network.
    dds_return_t result = dds_write(writer, &piece);
    for (int tries = 0; result == DDS_RETCODE_TIMEOUT && tries < 2000; ++tries) {
      dds_sleepfor(DDS_MSECS(1));
      result = dds_write(writer, &piece);
    }
    if (result != DDS_RETCODE_OK) {
      return false;
    }
  }
  return true;
}

void PieceAssembler::add(const PieceSample& piece) {
  check(piece);
  Assembly& assembly = assemblies_[{piece.kind, piece.number}];
  if (assembly.epoch != piece.epoch || assembly.parts != piece.parts) {
    assembly = {};
    assembly.epoch = piece.epoch;
    assembly.parts = piece.parts;
  }
  const auto bytes = bytes_of(piece.bytes);
  if (assembly.is_complete) {
    return;
  }
  assembly.received[piece.part].assign(bytes.begin(), bytes.end());
  if (assembly.received.size() == assembly.parts) {
    for (auto& [part, content] : assembly.received) {
      assembly.assembled.insert(assembly.assembled.end(), content.begin(), content.end());
    }
    assembly.received.clear();
    assembly.is_complete = true;
  }
}

const std::vector<std::byte>* PieceAssembler::find(PieceKind kind, std::uint32_t number, std::uint32_t epoch) const {
  const auto found = assemblies_.find({static_cast<std::uint32_t>(kind), number});
  const bool assembled = found != assemblies_.end() && found->second.is_complete && found->second.epoch == epoch;
  return assembled ? &found->second.assembled : nullptr;
}

void PieceAssembler::drop(PieceKind kind, std::uint32_t number) {
  assemblies_.erase({static_cast<std::uint32_t>(kind), number});
}

}  // namespace ringfence::dds
