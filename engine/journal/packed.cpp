#include "journal/packed.hpp"

#define XXH_INLINE_ALL
#include <memory>
#include <new>

#include <xxhash.h>
#include <zstd.h>

namespace ringfence::journal {

namespace {

constexpr int level = 1;  // the others take longer than they save

/// A save of 10^7 objects has 3 GB.
constexpr std::uint64_t max_size = std::uint64_t{1} << 36;

}  // namespace

std::uint64_t checksum_of(std::uint64_t key, std::uint64_t size, std::span<const std::byte> packed) noexcept {
  const std::uint64_t head[2] = {key, size};
  return XXH3_64bits_withSeed(packed.data(), packed.size(), XXH3_64bits(head, sizeof head));
}

Packed pack(std::uint64_t key, std::span<const std::byte> bytes) {
  Packed packed;
  packed.size = bytes.size();
  if (!bytes.empty()) {
    packed.bytes.resize(ZSTD_compressBound(bytes.size()));
    const std::size_t size = ZSTD_compress(packed.bytes.data(), packed.bytes.size(), bytes.data(), bytes.size(), level);
    if (ZSTD_isError(size) != 0) {
      throw std::bad_alloc();  // the only failure with enough room
    }
    packed.bytes.resize(size);
  }
  packed.checksum = checksum_of(key, packed.size, packed.bytes);
  return packed;
}

bool unpack(std::uint64_t key, std::uint64_t size, std::uint64_t checksum, std::span<const std::byte> packed,
            std::vector<std::byte>& bytes) {
  bytes.clear();
  if (size > max_size || checksum != checksum_of(key, size, packed)) {
    return false;
  }
  if (size == 0) {
    return packed.empty();
  }
  if (ZSTD_getFrameContentSize(packed.data(), packed.size()) != size) {
    return false;
  }
  bytes.resize(static_cast<std::size_t>(size));
  return ZSTD_decompress(bytes.data(), bytes.size(), packed.data(), packed.size()) == size;
}

}  // namespace ringfence::journal
