#pragma once

#include <cstddef>
#include <cstring>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace ringfence::base {

inline constexpr std::size_t system_page = 4096;
inline constexpr std::size_t huge_page = std::size_t{2} << 20;
/// Arrays of at least this size take their memory from the system, not from the heap.
inline constexpr std::size_t least_system_bytes = huge_page / 2;

/// Memory for a large array, from the system: at a multiple of `huge_page`, all bytes 0. A page occupies memory from
/// its first write on, so what is reserved and not used costs addresses only. The heap would reuse memory that start-up
/// has written and freed, all of which is resident. Throws std::bad_alloc.
inline void* allocate_from_system(std::size_t bytes) {
#ifdef __linux__
  // Reserves one huge page more than needed, and returns what is before and after the aligned part.
  const std::size_t reserved = bytes + huge_page;
  void* const memory = mmap(nullptr, reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) {
    throw std::bad_alloc();
  }
  auto* const begin = static_cast<std::byte*>(memory);
  const std::size_t before = (huge_page - reinterpret_cast<std::size_t>(begin) % huge_page) % huge_page;
  const std::size_t used = (bytes + system_page - 1) / system_page * system_page;
  if (before != 0) {
    (void)munmap(begin, before);
  }
  if (before + used < reserved) {
    (void)munmap(begin + before + used, reserved - before - used);
  }
  return begin + before;
#else
  void* const memory = ::operator new (bytes, std::align_val_t{huge_page});
  std::memset(memory, 0, bytes);
  return memory;
#endif
}

/// Frees what allocate_from_system() has returned for so many bytes.
inline void free_to_system(void* memory, std::size_t bytes) noexcept {
#ifdef __linux__
  (void)munmap(memory, bytes);
#else
  ::operator delete (memory, std::align_val_t{huge_page});
  (void)bytes;
#endif
}

/// Makes the pages of an array resident, so that no page fault happens when it is used. Its bytes keep their values.
/// One system call does that where the system has it: a page fault costs 1 to 20 µs.
inline void populate_pages(void* memory, std::size_t bytes) noexcept {
  if (bytes == 0) return;
#ifdef MADV_POPULATE_WRITE
  const std::size_t before = reinterpret_cast<std::size_t>(memory) % system_page;
  if (madvise(static_cast<std::byte*>(memory) - before, before + bytes, MADV_POPULATE_WRITE) == 0) return;
#endif
  auto* const first = static_cast<volatile std::byte*>(memory);
  for (std::size_t at = 0; at < bytes; at += system_page) first[at] = first[at];
  first[bytes - 1] = first[bytes - 1];
}

/// Returns the whole pages of an array, or of a part of it, to the system. Their bytes become unspecified; the memory
/// stays allocated, and occupies pages again when it is written.
inline void release_pages(void* memory, std::size_t bytes) noexcept {
#ifdef __linux__
  const auto begin = reinterpret_cast<std::size_t>(memory);
  const std::size_t first = (begin + system_page - 1) / system_page * system_page;
  const std::size_t end = (begin + bytes) / system_page * system_page;
  if (first < end) {
    (void)madvise(static_cast<std::byte*>(memory) + (first - begin), end - first, MADV_DONTNEED);
  }
#else
  (void)memory;
  (void)bytes;
#endif
}

}  // namespace ringfence::base
