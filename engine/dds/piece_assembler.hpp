#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "dds/wire.hpp"

namespace ringfence::dds {

/// Writes `bytes` as pieces of one thing: the last of each is kept for late joiners. False where the network took not
/// all of it. Threads: one at a time for a writer.
bool write_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t epoch,
                  std::span<const std::byte> bytes);

/// Where pieces are put together again. Threads: one.
class PieceAssembler {
 public:
  /// Takes a copy of the piece.
  void add(const PieceSample& piece);
  /// The thing, if all of it is here, with that epoch; lives until the next add of the same, or drop.
  const std::vector<std::byte>* find(PieceKind kind, std::uint32_t number, std::uint32_t epoch) const;
  void drop(PieceKind kind, std::uint32_t number);

 private:
  struct Assembly {
    std::uint32_t epoch = 0;
    std::uint32_t parts = 0;
    std::map<std::uint32_t, std::vector<std::byte>> here;
    std::vector<std::byte> assembled;
    bool is_complete = false;
  };
  std::map<std::tuple<std::uint32_t, std::uint32_t>, Assembly> assemblies_;
};

}  // namespace ringfence::dds
