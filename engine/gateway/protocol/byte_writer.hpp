#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace ringfence::gateway {

static_assert(std::endian::native == std::endian::little, "the values are copied as they are in memory");

/// Appends values of the protocol to bytes; docs/client-protocol.md, "Values". The bytes may be read when the writer is
/// destroyed.
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<std::byte>& bytes) noexcept : bytes_(&bytes), end_(bytes.size()) {}
  ~ByteWriter() { bytes_->resize(end_); }
  ByteWriter(const ByteWriter&) = delete;
  ByteWriter& operator=(const ByteWriter&) = delete;

  /// An integer or a floating-point number of fixed size.
  template <class T>
  requires std::is_arithmetic_v<T>
  void fixed(T value) {
    std::memcpy(room(sizeof value), &value, sizeof value);
    end_ += sizeof value;
  }
  /// `var`
  void var(std::uint64_t value) {
    std::byte* at = room(10);
    for (; value >= 0x80; value >>= 7) *at++ = static_cast<std::byte>(value | 0x80);
    *at++ = static_cast<std::byte>(value);
    end_ = static_cast<std::size_t>(at - bytes_->data());
  }
  /// `svar`
  void svar(std::int64_t value) {
    var(static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63));
  }
  /// `bytes`
  void bytes(std::span<const std::byte> value) {
    var(value.size());
    raw(value);
  }
  /// `text`
  void text(std::string_view value) { bytes(std::as_bytes(std::span(value))); }
  /// Bytes without their length.
  void raw(std::span<const std::byte> value) {
    if (!value.empty()) std::memcpy(room(value.size()), value.data(), value.size());
    end_ += value.size();
  }

 private:
  /// Where the next `size` bytes are written. The bytes are extended in steps, so that few values pay for it.
  std::byte* room(std::size_t size) {
    if (end_ + size > bytes_->size()) bytes_->resize(2 * bytes_->size() + size + 64);
    return bytes_->data() + end_;
  }

  std::vector<std::byte>* bytes_;
  std::size_t end_;
};

}  // namespace ringfence::gateway
