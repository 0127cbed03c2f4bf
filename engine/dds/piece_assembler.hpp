#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "dds/wire.hpp"

namespace ringfence::dds {

/// Writes `bytes` as a sequence of pieces, which DDS keeps for late joiners. False if the network did not take all of
/// them. Threads: one at a time per writer.
bool write_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t epoch,
                  std::span<const std::byte> bytes);

/// Number of pieces of so many bytes.
std::size_t piece_parts(std::size_t bytes) noexcept;
/// Disposes the pieces from part `first` to part `end` - 1 of something that was replaced by less.
void dispose_pieces(dds_entity_t writer, std::uint64_t world, PieceKind kind, std::uint32_t number, std::uint32_t first,
                    std::uint32_t end) noexcept;

/// Reassembles pieces. Threads: one.
class PieceAssembler {
 public:
  /// Copies the piece. Throws Error if its kind is unknown, or if it has more or larger parts than a World sends.
  void add(const PieceSample& piece);
  /// The complete bytes with that epoch, or null; valid until the next add of the same kind and number, or drop.
  const std::vector<std::byte>* find(PieceKind kind, std::uint32_t number, std::uint32_t epoch) const;
  void drop(PieceKind kind, std::uint32_t number);

 private:
  struct Assembly {
    std::uint32_t epoch = 0;
    std::uint32_t parts = 0;
    std::map<std::uint32_t, std::vector<std::byte>> received;
    std::vector<std::byte> assembled;
    bool is_complete = false;
  };
  std::map<std::tuple<std::uint32_t, std::uint32_t>, Assembly> assemblies_;
};

}  // namespace ringfence::dds
