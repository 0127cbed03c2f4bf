#include "dds/shelf.hpp"

#include <algorithm>

namespace ringfence::dds {

namespace {

constexpr std::size_t piece_bytes = 48'000;

}  // namespace

bool put_on_shelf(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t epoch,
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

void Shelf::add(const PieceSample& piece) {
  Thing& thing = things_[{piece.kind, piece.number}];
  if (thing.epoch != piece.epoch || thing.parts != piece.parts) {
    thing = {};
    thing.epoch = piece.epoch;
    thing.parts = piece.parts;
  }
  const auto bytes = bytes_of(piece.bytes);
  if (thing.is_whole || piece.part >= piece.parts) {
    return;
  }
  thing.here[piece.part].assign(bytes.begin(), bytes.end());
  if (thing.here.size() == thing.parts) {
    for (auto& [part, content] : thing.here) {
      thing.whole.insert(thing.whole.end(), content.begin(), content.end());
    }
    thing.here.clear();
    thing.is_whole = true;
  }
}

const std::vector<std::byte>* Shelf::find(PieceKind kind, std::uint32_t number, std::uint32_t epoch) const {
  const auto found = things_.find({static_cast<std::uint32_t>(kind), number});
  const bool whole = found != things_.end() && found->second.is_whole && found->second.epoch == epoch;
  return whole ? &found->second.whole : nullptr;
}

void Shelf::drop(PieceKind kind, std::uint32_t number) { things_.erase({static_cast<std::uint32_t>(kind), number}); }

}  // namespace ringfence::dds
