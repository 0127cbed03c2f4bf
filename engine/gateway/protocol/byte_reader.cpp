#include "gateway/protocol/byte_reader.hpp"

#include <limits>

namespace ringfence::gateway {

std::uint64_t ByteReader::var() noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < rest_.size() && i < 10; ++i) {
    const auto group = static_cast<std::uint64_t>(rest_[i]);
    if (i == 9 && group > 1) break;  // more than 64 bits
    value |= (group & 0x7f) << (7 * i);
    if (group < 0x80) {
      if (group == 0 && i > 0) break;  // a shorter form exists
      rest_ = rest_.subspan(i + 1);
      return value;
    }
  }
  fail();
  return 0;
}

std::uint32_t ByteReader::var32() noexcept {
  const std::uint64_t value = var();
  if (value > std::numeric_limits<std::uint32_t>::max()) {
    fail();
    return 0;
  }
  return static_cast<std::uint32_t>(value);
}

std::span<const std::byte> ByteReader::bytes(std::size_t limit) noexcept {
  const std::uint64_t size = var();
  if (size > limit) {
    fail();
    return {};
  }
  return raw(size);
}

std::span<const std::byte> ByteReader::raw(std::size_t size) noexcept {
  if (size > rest_.size()) {
    fail();
    return {};
  }
  const auto taken = rest_.first(size);
  rest_ = rest_.subspan(size);
  return taken;
}

std::size_t ByteReader::count(std::size_t least) noexcept {
  const std::uint64_t value = var();
  if (value > rest_.size() / least) {
    fail();
    return 0;
  }
  return value;
}

}  // namespace ringfence::gateway
