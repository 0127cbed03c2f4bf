#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace ringfence {

/// Receives the bytes of World::save, in order: implement it to write a file, a database or a socket.
class Sink {
 public:
  virtual ~Sink() = default;
  /// Takes the next bytes; they are valid during the call. Returns false if they cannot be kept: the save then ends,
  /// and what was written so far is of no use.
  virtual bool write(std::span<const std::byte> bytes) = 0;
};

/// Delivers the bytes of a save, in order, to the constructor of World.
class Source {
 public:
  virtual ~Source() = default;
  /// Writes up to bytes.size() bytes, which is not 0, to `bytes`. Returns their number; 0 at the end. May throw.
  virtual std::size_t read(std::span<std::byte> bytes) = 0;
};

/// Keeps a save in memory.
class MemorySink final : public Sink {
 public:
  bool write(std::span<const std::byte> bytes) override {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return true;
  }
  const std::vector<std::byte>& bytes() const noexcept { return bytes_; }
  /// Moves the bytes out; then it has none.
  std::vector<std::byte> take() noexcept { return std::exchange(bytes_, {}); }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads a save from memory, which outlives it.
class MemorySource final : public Source {
 public:
  explicit MemorySource(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}
  std::size_t read(std::span<std::byte> bytes) override;

 private:
  std::span<const std::byte> rest_;
};

}  // namespace ringfence
