#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "link/stream_end.hpp"

namespace ringfence::dds {

/// Memory that two processes of one machine share for the bytes of a link: one ring in each direction. One process
/// creates it and sends its file descriptor to the other one, which opens it; no other process can open it by a name.
///
/// The other process is not trusted (see link::StreamEnd): the sizes are read once and checked, and the memory cannot
/// shrink. Each ring is mapped twice, one copy behind the other, so all bytes that may be read or written are
/// contiguous.
///
/// Threads: one. Memory: address space of twice the rings; their pages are allocated by create().
class SharedRings {
 public:
  using End = link::StreamEnd<link::ProcessAtomics>;

  /// Memory with rings of these sizes in bytes, from and to this process: powers of two, at least a page. Null if the
  /// system has no such memory.
  static std::unique_ptr<SharedRings> create(std::size_t out_bytes, std::size_t in_bytes) noexcept;
  /// The memory that another process has created. Null if `descriptor` is not such memory, or cannot be mapped. The
  /// caller closes the descriptor.
  static std::unique_ptr<SharedRings> open(int descriptor) noexcept;
  ~SharedRings();
  SharedRings(const SharedRings&) = delete;
  SharedRings& operator=(const SharedRings&) = delete;

  /// The descriptor to send to the other process; -1 after close_descriptor(), and in the process that has opened it.
  int descriptor() const noexcept { return descriptor_; }
  void close_descriptor() noexcept;

  End& end() noexcept { return end_; }
  const End& end() const noexcept { return end_; }
  /// The byte at a position that may be written, and those behind it.
  std::byte* out_at(std::uint64_t position) noexcept { return out_ + (position & (layout_.out_bytes - 1)); }
  /// The byte at a position that may be read, and those behind it. The other process may change them at any time.
  const std::byte* in_at(std::uint64_t position) const noexcept { return in_ + (position & (layout_.in_bytes - 1)); }

 private:
  /// Where everything is, as one of the two processes sees it.
  struct Layout {
    int side = 0;
    std::size_t control_bytes = 0;
    std::size_t out_bytes = 0, in_bytes = 0;
    std::size_t mapped() const noexcept { return control_bytes + 2 * (out_bytes + in_bytes); }
  };

  static std::byte* map(int descriptor, const Layout& layout) noexcept;
  SharedRings(int descriptor, const Layout& layout, std::byte* memory) noexcept;

  int descriptor_;
  Layout layout_;
  std::byte* memory_;
  std::byte* out_;
  const std::byte* in_;
  End end_;
};

}  // namespace ringfence::dds
