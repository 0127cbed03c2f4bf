#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ringfence::journal {

/// Bytes as they are stored: compressed with zstd, with their size, and a checksum (XXH3, 64 bits) of size, key and
/// compressed bytes.
struct Packed {
  std::vector<std::byte> bytes;
  std::uint64_t size = 0;
  std::uint64_t checksum = 0;
};

/// `key`: what the bytes belong to, such as the number of a frame. Throws std::bad_alloc.
Packed pack(std::uint64_t key, std::span<const std::byte> bytes);

std::uint64_t checksum_of(std::uint64_t key, std::uint64_t size, std::span<const std::byte> packed) noexcept;

/// The bytes again. Returns false if the checksum does not match, or if they are not `size` bytes.
bool unpack(std::uint64_t key, std::uint64_t size, std::uint64_t checksum, std::span<const std::byte> packed,
            std::vector<std::byte>& bytes);

}  // namespace ringfence::journal
