#include "journal/save_parts.hpp"

#define XXH_INLINE_ALL
#include <algorithm>
#include <cstring>

#include <xxhash.h>

namespace ringfence::journal {

bool PartsSink::write(std::span<const std::byte> bytes) {
  const std::size_t begin = save_.bytes.size();
  save_.bytes.insert(save_.bytes.end(), bytes.begin(), bytes.end());
  if (bytes.size() >= least_part) {
    save_.parts.push_back({begin, save_.bytes.size()});
  }
  return true;
}

PartName name_of_part(std::span<const std::byte> part) noexcept {
  const XXH128_hash_t hash = XXH3_128bits(part.data(), part.size());
  return {hash.low64, hash.high64};
}

Recipe recipe_of(const SaveInParts& save) {
  Recipe recipe;
  const std::span<const std::byte> all(save.bytes);
  std::size_t done = 0;
  const auto add_bytes = [&](std::size_t end) {
    if (end > done) {
      recipe.pieces.push_back({end - done, {}, 0});
      recipe.bytes.insert(recipe.bytes.end(), all.begin() + static_cast<std::ptrdiff_t>(done),
                          all.begin() + static_cast<std::ptrdiff_t>(end));
    }
  };
  for (const auto& [begin, end] : save.parts) {
    add_bytes(begin);
    recipe.pieces.push_back({end - begin, name_of_part(all.subspan(begin, end - begin)), 1});
    done = end;
  }
  add_bytes(all.size());
  return recipe;
}

std::vector<std::byte> write_recipe(const Recipe& recipe) {
  const std::uint64_t count = recipe.pieces.size();
  const auto pieces = std::as_bytes(std::span(recipe.pieces));
  std::vector<std::byte> bytes(sizeof count + pieces.size() + recipe.bytes.size());
  std::memcpy(bytes.data(), &count, sizeof count);
  const auto after_pieces = std::copy(pieces.begin(), pieces.end(), bytes.begin() + sizeof count);
  std::copy(recipe.bytes.begin(), recipe.bytes.end(), after_pieces);
  return bytes;
}

bool read_recipe(std::span<const std::byte> bytes, Recipe& recipe) {
  std::uint64_t count = 0;
  if (bytes.size() < sizeof count) {
    return false;
  }
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes = bytes.subspan(sizeof count);
  if (count > bytes.size() / sizeof(Piece)) {
    return false;
  }
  recipe.pieces.resize(static_cast<std::size_t>(count));
  if (!recipe.pieces.empty()) {
    std::memcpy(recipe.pieces.data(), bytes.data(), recipe.pieces.size() * sizeof(Piece));
  }
  bytes = bytes.subspan(recipe.pieces.size() * sizeof(Piece));
  recipe.bytes.assign(bytes.begin(), bytes.end());
  std::uint64_t left = bytes.size();
  for (const Piece& piece : recipe.pieces) {
    const bool fits = piece.is_part != 0 || piece.size <= left;
    if (piece.is_part > 1 || !fits) {
      return false;
    }
    left -= piece.is_part != 0 ? 0 : piece.size;
  }
  return left == 0;
}

}  // namespace ringfence::journal
