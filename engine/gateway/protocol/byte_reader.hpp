#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace ringfence::gateway {

/// Reads values of the protocol from bytes that may be anything; docs/client-protocol.md, "Values". After the first
/// value that does not fit, ok() is false and every further value is 0 or empty.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}

  bool ok() const noexcept { return ok_; }
  /// Whether all values were read without an error and nothing is left.
  bool at_end() const noexcept { return ok_ && rest_.empty(); }
  std::size_t left() const noexcept { return rest_.size(); }

  template <class T>
  requires std::is_arithmetic_v<T> T fixed()
  noexcept {
    T value{};
    if (const auto taken = raw(sizeof value); ok_) std::memcpy(&value, taken.data(), sizeof value);
    return value;
  }
  /// `var`; only the shortest form of a value is accepted, so that each value has one form.
  std::uint64_t var() noexcept;
  /// A `var` that is less than 2^32.
  std::uint32_t var32() noexcept;
  /// `svar`
  std::int64_t svar() noexcept {
    const std::uint64_t value = var();
    return static_cast<std::int64_t>(value >> 1 ^ (0 - (value & 1)));
  }
  /// `bytes` of at most `limit`.
  std::span<const std::byte> bytes(std::size_t limit) noexcept;
  /// `text` of at most `limit` bytes.
  std::string_view text(std::size_t limit) noexcept {
    const auto taken = bytes(limit);
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }
  /// `size` bytes.
  std::span<const std::byte> raw(std::size_t size) noexcept;
  /// All that is left.
  std::span<const std::byte> rest() noexcept { return raw(rest_.size()); }
  /// Number of a list's records, each of which has at least `least` bytes.
  std::size_t count(std::size_t least) noexcept;
  void fail() noexcept {
    ok_ = false;
    rest_ = {};
  }

 private:
  std::span<const std::byte> rest_;
  bool ok_ = true;
};

}  // namespace ringfence::gateway
