#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <type_traits>
#include <utility>

#include "base/system_memory.hpp"

namespace ringfence::base {

/// The pages of a Buffer.
enum class Pages : unsigned char {
  huge,  ///< as far as the array is large: for arrays that are usually full
  small  ///< for arrays that are reserved for more than a frame usually needs: only what is used occupies memory
};

/// An array of trivially copyable elements that grows and never shrinks. New elements are not initialised.
///
/// Arrays of at least 1 MiB come from the system (allocate_from_system) and request huge pages of 2 MiB: a million
/// objects are accessed in an order that causes many TLB misses with small pages. Whatever an array occupies beyond its
/// last whole huge page is in small pages, unless a huge page would waste at most an eighth of itself; so a world of
/// 64,000 objects, most of whose arrays have 1 to 6 MB, does not pay for half a huge page per array. The functions that
/// grow throw std::bad_alloc.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept
      : first_(std::exchange(other.first_, nullptr)),
        capacity_(std::exchange(other.capacity_, 0)),
        bytes_(std::exchange(other.bytes_, 0)),
        huge_bytes_(std::exchange(other.huge_bytes_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(first_, other.first_);
    std::swap(capacity_, other.capacity_);
    std::swap(bytes_, other.bytes_);
    std::swap(huge_bytes_, other.huge_bytes_);
    return *this;
  }
  ~Buffer() { release(); }

  /// Ensures room for `count` elements. If the array has to grow, its contents are lost.
  void reserve(std::size_t count) {
    if (count <= capacity_) return;
    release();
    allocate(count + count / 4);
  }

  /// Ensures room for `count` elements. Keeps the first `used` elements.
  void grow(std::size_t count, std::size_t used, Pages pages = Pages::huge) {
    if (count <= capacity_) return;
    Buffer larger;
    larger.allocate(std::max(count, 2 * capacity_), pages);
    if (used != 0) std::memcpy(larger.first_, first_, used * sizeof(T));
    *this = std::move(larger);
  }

  /// For an array with small pages: requests huge pages as far as the first `count` elements fill them, to the nearest
  /// whole page.
  void request_huge_pages(std::size_t count) noexcept {
    advise_huge(std::min(count * sizeof(T) + huge_page / 2, bytes_) / huge_page * huge_page);
  }

  /// Returns the whole pages of the elements [first, end) to the system. These elements lose their values, and occupy
  /// memory again when they are written.
  void release_pages(std::size_t first, std::size_t end) noexcept {
    base::release_pages(first_ + first, (end - first) * sizeof(T));
  }

  T* data() noexcept { return first_; }
  const T* data() const noexcept { return first_; }
  std::size_t capacity() const noexcept { return capacity_; }
  T& operator[](std::size_t i) noexcept { return first_[i]; }
  const T& operator[](std::size_t i) const noexcept { return first_[i]; }

 private:
  void allocate(std::size_t count, Pages pages = Pages::huge) {
    const std::size_t needed = count * sizeof(T);
    const std::size_t huge = (needed + huge_page / 8) / huge_page * huge_page;
    bytes_ = std::max(huge, (needed + 63) / 64 * 64);
    first_ = static_cast<T*>(bytes_ >= least_system_bytes ? allocate_from_system(bytes_)
                                                          : ::operator new (bytes_, std::align_val_t{64}));
    capacity_ = bytes_ / sizeof(T);
    huge_bytes_ = 0;
    if (pages == Pages::huge) advise_huge(huge);
  }
  // Only advice: without huge pages everything works, but slower.
  void advise_huge(std::size_t bytes) noexcept {
    if (bytes <= huge_bytes_) return;
#ifdef __linux__
    (void)madvise(first_, bytes, MADV_HUGEPAGE);
#endif
    huge_bytes_ = bytes;
  }
  void release() noexcept {
    if (first_ != nullptr) {
      bytes_ >= least_system_bytes ? free_to_system(first_, bytes_) : ::operator delete (first_, std::align_val_t{64});
    }
    first_ = nullptr;
    capacity_ = 0;
  }

  T* first_ = nullptr;
  std::size_t capacity_ = 0;
  std::size_t bytes_ = 0;
  std::size_t huge_bytes_ = 0;  ///< from the start: huge pages were requested
};

}  // namespace ringfence::base
