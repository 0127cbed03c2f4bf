#pragma once

#include <cstddef>
#include <span>

#include "base/buffer.hpp"

namespace ringfence::base {

/// A list of trivially copyable elements that is emptied and filled each frame. Like std::vector, but it does not
/// initialise elements that are about to be written, and lists of at least 1 MiB request huge pages. With 64,000
/// objects a frame accesses 30 MB, more than the TLB covers with small pages; huge pages save a seventh of the frame's
/// time.
///
/// Threads: not synchronised; the owner decides who may access the list. Memory: grows to the largest frame, never
/// shrinks. The functions that grow throw std::bad_alloc, and invalidate pointers and references to elements.
template <class T>
class FlatList {
 public:
  /// Ensures room for `count` elements.
  void reserve(std::size_t count) { buffer_.grow(count, size_); }
  /// The same for a list that is usually much shorter: only what is used occupies memory.
  void reserve_rarely_used(std::size_t count) { buffer_.grow(count, size_, Pages::small); }
  /// After resize() of such a list, which may be long: requests huge pages as far as the elements fill them.
  void request_huge_pages() noexcept { request_huge_pages(size_); }
  /// The same as far as the first `count` elements will fill them.
  void request_huge_pages(std::size_t count) noexcept { buffer_.request_huge_pages(count); }
  std::size_t size() const noexcept { return size_; }
  bool empty() const noexcept { return size_ == 0; }
  void clear() noexcept { size_ = 0; }

  /// Appends an element that is not initialised, and returns it.
  T& add() {
    if (size_ == buffer_.capacity()) [[unlikely]] {
      buffer_.grow(size_ + 1, size_);
    }
    return buffer_[size_++];
  }
  /// Precondition: `value` is not an element of this list.
  void push_back(const T& value) { add() = value; }
  void pop_back() noexcept { --size_; }
  /// Changes the size. New elements are not initialised.
  void resize(std::size_t size) {
    buffer_.grow(size, size_);
    size_ = size;
  }

  /// Gives the pages of the elements [first, end) back to the system; these elements lose their values.
  void release_pages(std::size_t first, std::size_t end) noexcept { buffer_.release_pages(first, end); }
  /// The same for the elements that are reserved and not used.
  void release_unused_pages() noexcept { buffer_.release_pages(size_, buffer_.capacity()); }

  T* data() noexcept { return buffer_.data(); }
  const T* data() const noexcept { return buffer_.data(); }
  T& operator[](std::size_t i) noexcept { return buffer_[i]; }
  const T& operator[](std::size_t i) const noexcept { return buffer_[i]; }
  T& back() noexcept { return buffer_[size_ - 1]; }
  T* begin() noexcept { return data(); }
  T* end() noexcept { return data() + size_; }
  const T* begin() const noexcept { return data(); }
  const T* end() const noexcept { return data() + size_; }
  std::span<const T> span() const noexcept { return {data(), size_}; }

 private:
  Buffer<T> buffer_;
  std::size_t size_ = 0;
};

}  // namespace ringfence::base
