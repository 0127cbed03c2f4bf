#include "dds/piece_assembler.hpp"

#include <algorithm>

namespace ringfence::dds {

namespace {

constexpr std::size_t piece_bytes = 48'000;

}  // namespace

bool write_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t epoch,
                  std::span<const std::byte> bytes) {
  const std::size_t parts = std::max<std::size_t>(1, (bytes.size() + piece_bytes - 1) / piece_bytes);
  for (std::size_t part = 0; part < parts; ++part) {
    const auto slice = bytes.subspan(part * piece_bytes, std::min(piece_bytes, bytes.size() - part * piece_bytes));
    const PieceSample piece{world,
                            static_cast<std::uint32_t>(kind),
                            number,
                            static_cast<std::uint32_t>(part),
                            static_cast<std::uint32_t>(parts),
                            epoch,
                            borrow(slice)};
    // Between frames, and rare: so it may wait for a network that is behind.
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
  Assembly& thing = assemblies_[{piece.kind, piece.number}];
  if (thing.epoch != piece.epoch || thing.parts != piece.parts) {
    thing = {};
    thing.epoch = piece.epoch;
    thing.parts = piece.parts;
  }
  const auto bytes = bytes_of(piece.bytes);
  if (thing.is_complete || piece.part >= piece.parts) {
    return;
  }
  thing.here[piece.part].assign(bytes.begin(), bytes.end());
  if (thing.here.size() == thing.parts) {
    for (auto& [part, content] : thing.here) {
      thing.assembled.insert(thing.assembled.end(), content.begin(), content.end());
    }
    thing.here.clear();
    thing.is_complete = true;
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
