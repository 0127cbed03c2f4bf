#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <ranges>
#include <span>

#include "ringfence/contact.hpp"

namespace ringfence {

/// The contacts of one object in one frame, in order of (a, b): a random access range of const Contact, read in place.
///
///   for (const ringfence::Contact& contact : world.collisions_of(object)) respond(contact);
///
/// A view: two pointers and a size, cheap to copy. Lifetime: that of the contacts, also of iterators and references;
/// World::collisions_of and MotionInput::contacts state it.
class ObjectContacts {
 public:
  /// Random access. Comparable with iterators of the same object's contacts.
  class Iterator {
   public:
    using iterator_concept = std::random_access_iterator_tag;
    using iterator_category = std::random_access_iterator_tag;
    using value_type = Contact;
    using difference_type = std::ptrdiff_t;
    using pointer = const Contact*;
    using reference = const Contact&;

    Iterator() = default;
    reference operator*() const noexcept { return all_[*index_]; }
    pointer operator->() const noexcept { return &all_[*index_]; }
    reference operator[](difference_type n) const noexcept { return all_[index_[n]]; }
    Iterator& operator++() noexcept { return *this += 1; }
    Iterator& operator--() noexcept { return *this -= 1; }
    Iterator operator++(int) noexcept { return step(1); }
    Iterator operator--(int) noexcept { return step(-1); }
    Iterator& operator+=(difference_type n) noexcept {
      index_ += n;
      return *this;
    }
    Iterator& operator-=(difference_type n) noexcept { return *this += -n; }
    friend Iterator operator+(Iterator i, difference_type n) noexcept { return i += n; }
    friend Iterator operator+(difference_type n, Iterator i) noexcept { return i += n; }
    friend Iterator operator-(Iterator i, difference_type n) noexcept { return i -= n; }
    friend difference_type operator-(const Iterator& p, const Iterator& q) noexcept { return p.index_ - q.index_; }
    friend bool operator==(const Iterator& p, const Iterator& q) noexcept { return p.index_ == q.index_; }
    friend auto operator<=>(const Iterator& p, const Iterator& q) noexcept { return p.index_ <=> q.index_; }

   private:
    friend class ObjectContacts;
    Iterator(const Contact* all, const std::uint32_t* index) noexcept : all_(all), index_(index) {}
    Iterator step(difference_type n) noexcept {
      const Iterator before = *this;
      *this += n;
      return before;
    }

    const Contact* all_ = nullptr;
    const std::uint32_t* index_ = nullptr;
  };

  using value_type = Contact;
  using size_type = std::size_t;
  using iterator = Iterator;
  using const_iterator = Iterator;

  /// No contacts.
  ObjectContacts() = default;
  /// The contacts all[i] for each i of `indices`.
  ObjectContacts(const Contact* all, std::span<const std::uint32_t> indices) noexcept : all_(all), indices_(indices) {}

  Iterator begin() const noexcept { return {all_, indices_.data()}; }
  Iterator end() const noexcept { return {all_, indices_.data() + indices_.size()}; }
  std::size_t size() const noexcept { return indices_.size(); }
  bool empty() const noexcept { return indices_.empty(); }
  /// Precondition: i < size().
  const Contact& operator[](std::size_t i) const noexcept { return all_[indices_[i]]; }
  /// Precondition: not empty().
  const Contact& front() const noexcept { return (*this)[0]; }
  const Contact& back() const noexcept { return (*this)[size() - 1]; }

 private:
  const Contact* all_ = nullptr;
  std::span<const std::uint32_t> indices_;
};

}  // namespace ringfence

// Iterators refer to the contacts, not to the range.
template <>
inline constexpr bool std::ranges::enable_borrowed_range<ringfence::ObjectContacts> = true;
template <>
inline constexpr bool std::ranges::enable_view<ringfence::ObjectContacts> = true;
