#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "geometry/bounds.hpp"
#include "messages/records.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::nodes {

/// Who hosts an object from the next frame on, as far as a CD node knows.
enum class NextHost : std::uint8_t {
  self,  ///< the node
  node,  ///< another CD node: the one that owns the cell of its position, in user/collision deployment
  user,  ///< a user node
  none,  ///< it does not move
};

/// The objects that overlap a CD node's region, as the node last heard of them, packed for its sweep and narrow phase.
///
/// Threads: belongs to its CD node. Memory: grows with the objects known; four bytes a slot of the world.
class RegionObjects {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  /// `sweeps`: bounds, layers and what rests are kept for a sweep; else nobody asks for them.
  RegionObjects(std::size_t objects, bool sweeps);

  std::size_t size() const noexcept { return slots_.size(); }
  /// Index of the object in a slot, or none.
  std::uint32_t find(std::uint32_t slot) const noexcept { return slot < index_.size() ? index_[slot] : none; }

  /// The same, for who remembers where it was: that is looked at first. The table by slot has a line of the cache for
  /// each of a node's objects, the list of slots for sixteen.
  std::uint32_t find(std::uint32_t slot, std::uint32_t was) const noexcept {
    return was < slots_.size() && slots_[was] == slot ? was : find(slot);
  }

  /// Adds an object or replaces what is known of it, and says where it is. `inner`: all that its bounds touch is the
  /// node's. `was`: where it may be, as in find(). `hosted`: where the node hosts it at the time, if it does.
  std::uint32_t set(const messages::ObjectRef& object, const Pose& pose, const geometry::Bounds& bounds,
                    ShapeNumber shape, std::uint32_t layer, NextHost next, bool inner, std::uint32_t was = none,
                    std::uint32_t hosted = none) {
    std::uint32_t i = find(object.slot, was);
    if (i == none) [[unlikely]] {
      i = add(object.slot);
    }
    if (bodies_[i].number != object.number) [[unlikely]] {  // else what does not change is there
      numbers_[i] = object.number;
      layers_[i] = static_cast<std::uint8_t>(layer);
    }
    bodies_[i] = {pose, shape, object.number};
    marks_[i] = static_cast<std::uint8_t>((inner ? inner_mark : 0) | static_cast<unsigned>(next));
    hosted_[i] = hosted;
    if (sweeps_) {
      bounds_[i] = bounds;
      resting_[i] = 0;
    }
    return i;
  }
  /// Fetches what find() of that slot will look at.
  void prefetch_index(std::uint32_t slot) const noexcept {
    if (slot < index_.size()) {
      base::prefetch_for_read(&index_[slot]);
    }
  }
  /// Fetches what find() where it was will look at, whether it was inner, and the most of what set() of the i-th will
  /// write; nothing if it is none.
  void prefetch(std::uint32_t i) const noexcept {
    if (i < slots_.size()) {
      base::prefetch_for_read(&slots_[i]);
      base::prefetch_for_write(&marks_[i]);
      base::prefetch_for_write(&hosted_[i]);
      base::prefetch_for_write(&bodies_[i]);
      base::prefetch_for_write(reinterpret_cast<const std::byte*>(&bodies_[i] + 1) - 1);
      if (sweeps_) {
        base::prefetch_for_write(&bounds_[i]);
        base::prefetch_for_write(reinterpret_cast<const std::byte*>(&bounds_[i] + 1) - 1);
        base::prefetch_for_write(&resting_[i]);
      }
    }
  }
  /// Forgets it; the last one takes its index. Does nothing if it is not known.
  void forget(std::uint32_t slot);
  void clear() noexcept;

  std::span<const narrow_phase::Body> bodies() const noexcept { return bodies_.span(); }
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_.span(); }
  std::uint32_t slot(std::size_t i) const noexcept { return slots_[i]; }
  /// As set() was last told.
  NextHost next_host(std::size_t i) const noexcept { return static_cast<NextHost>(marks_[i] & ~inner_mark); }
  /// Where the node hosted the i-th when it last set() it, or none.
  std::uint32_t hosted(std::size_t i) const noexcept { return hosted_[i]; }
  /// Whether set() was last told that it is inner. That it is not, is always right, but costs time.
  bool inner(std::size_t i) const noexcept { return (marks_[i] & inner_mark) != 0; }
  /// One byte each, in which inner_mark says that.
  std::span<const std::uint8_t> marks() const noexcept { return marks_; }
  static constexpr unsigned inner_mark = 4;
  /// Likewise, when note_inner() was last called.
  bool was_inner(std::size_t i) const noexcept { return (marks_before_[i] & inner_mark) != 0; }
  void note_inner() noexcept { std::copy(marks_.begin(), marks_.end(), marks_before_.begin()); }
  /// The number of each; bodies() has them, too, a cache line each.
  std::span<const ObjectNumber> numbers() const noexcept { return numbers_.span(); }
  std::span<const std::uint8_t> layers() const noexcept { return layers_; }

  /// One byte an object: 1 where nothing about it has changed since the last call of settle().
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }
  /// One byte an object, all 1: what is known is present.
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  void settle() noexcept;

 private:
  std::uint32_t add(std::uint32_t slot);

  bool sweeps_;
  std::vector<std::uint32_t> index_;  ///< by slot
  base::FlatList<std::uint32_t> slots_;
  base::FlatList<narrow_phase::Body> bodies_;
  base::FlatList<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> layers_;
  base::FlatList<ObjectNumber> numbers_;
  base::FlatList<std::uint32_t> hosted_;
  std::vector<std::uint8_t> marks_;  ///< NextHost, and inner_mark
  std::vector<std::uint8_t> marks_before_;
  std::vector<std::uint8_t> resting_;
  std::vector<std::uint8_t> present_;
};

}  // namespace ringfence::nodes
