#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "ringfence/save.hpp"

namespace ringfence::facade {

static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

/// Writes values to a sink, and their checksum at the end.
class SaveWriter {
 public:
  explicit SaveWriter(Sink& sink);
  ~SaveWriter();
  SaveWriter(const SaveWriter&) = delete;
  SaveWriter& operator=(const SaveWriter&) = delete;

  void bytes(std::span<const std::byte> bytes);
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void value(const T& value) { bytes(std::as_bytes(std::span(&value, 1))); }
  /// The number of records, then the records.
  template <class T>
  void list(std::span<const T> records) {
    value(std::uint64_t{records.size()});
    bytes(std::as_bytes(records));
  }
  template <class T>
  void list(const std::vector<T>& records) {
    list(std::span<const T>(records));
  }
  void text(std::string_view text) { list(std::span(text.data(), text.size())); }
  /// Writes the checksum. Returns whether the sink has taken everything.
  bool finish();

 private:
  struct Checksum;
  Sink& sink_;
  std::unique_ptr<Checksum> checksum_;
  bool taken_ = true;
};

/// Reads what SaveWriter wrote. Throws Error if the bytes end too early.
class SaveReader {
 public:
  /// Reads all of the source. Throws Error unless it ends with the checksum of the rest.
  explicit SaveReader(Source& source);
  /// Reads from memory, without a checksum. The bytes outlive the reader.
  explicit SaveReader(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}

  std::span<const std::byte> bytes(std::size_t count);
  template <class T>
  requires std::is_trivially_copyable_v<T> T value() {
    T value;
    copy(bytes(sizeof value), &value);
    return value;
  }
  template <class T>
  requires std::is_trivially_copyable_v<T> std::vector<T> list() {
    const auto count = value<std::uint64_t>();
    std::vector<T> records(checked_count(count, sizeof(T)));
    copy(bytes(records.size() * sizeof(T)), records.data());
    return records;
  }
  std::string text();
  /// Number of bytes that were not read.
  std::size_t left() const noexcept { return rest_.size(); }

 private:
  /// Throws Error unless so many records may follow: memory is allocated only for what is there.
  std::size_t checked_count(std::uint64_t count, std::size_t each) const;
  static void copy(std::span<const std::byte> from, void* to) noexcept;

  std::vector<std::byte> all_;
  std::span<const std::byte> rest_;
};

}  // namespace ringfence::facade
