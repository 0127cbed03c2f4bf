#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "ringfence/save.hpp"

namespace ringfence::journal {

/// A write of at least this size is a part of its own: the points of a hull, the triangles of a mesh, a list of
/// objects. Snapshots that have the same part share it, so a shape is stored once however many snapshots have it.
inline constexpr std::size_t least_part = 4096;

/// What World::save wrote, and where its parts are.
struct SaveInParts {
  struct Range {
    std::size_t begin, end;
  };
  std::vector<std::byte> bytes;
  std::vector<Range> parts;  ///< ascending
};

/// Keeps a save in memory, with its parts.
class PartsSink final : public Sink {
 public:
  bool write(std::span<const std::byte> bytes) override;
  /// Moves the save out; then it has none.
  SaveInParts take() noexcept { return std::exchange(save_, {}); }

 private:
  SaveInParts save_;
};

/// The name of a part is a hash of its content (XXH3, 128 bits). Two parts with one name would be found at the latest
/// by the checksum of the whole save.
struct PartName {
  std::uint64_t low = 0, high = 0;
  friend bool operator==(const PartName&, const PartName&) = default;
};
PartName name_of_part(std::span<const std::byte> part) noexcept;

/// A piece of a save, in order: bytes that are in the recipe, or a part.
struct Piece {
  std::uint64_t size = 0;
  PartName part;
  std::uint64_t is_part = 0;  ///< 0: the bytes are in the recipe
};
static_assert(sizeof(Piece) == 32);

/// What a snapshot stores: the number of pieces, the pieces, and the bytes of those that are not parts.
struct Recipe {
  std::vector<Piece> pieces;
  std::vector<std::byte> bytes;
};
Recipe recipe_of(const SaveInParts& save);
std::vector<std::byte> write_recipe(const Recipe& recipe);
/// Returns false if the bytes are not exactly one recipe.
bool read_recipe(std::span<const std::byte> bytes, Recipe& recipe);

}  // namespace ringfence::journal
