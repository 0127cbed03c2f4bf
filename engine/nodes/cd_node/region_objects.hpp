#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/frame_stamp.hpp"
#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "broad_phase/layers.hpp"
#include "geometry/bounds.hpp"
#include "messages/records.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::nodes {

/// Who hosts an object from the next frame on, as far as a CD node knows.
enum class NextHost : std::uint8_t {
  self,  ///< this node
  node,  ///< another CD node: in user/collision deployment the owner of the cell that contains the object's position
  user,  ///< a user node
  none,  ///< the object does not move
};

/// What decides beside the bounds whether two objects are a candidate pair; see SweepAndPrune::find.
struct PairFilter {
  std::uint8_t layer = 0;  ///< with broad_phase::fixed_object for a static object
  std::uint32_t group = 0;
  std::uint32_t crowd = 0;

  static constexpr PairFilter of(std::uint32_t layer, bool fixed, std::uint32_t group,
                                 std::uint32_t crowd = 0) noexcept {
    return {static_cast<std::uint8_t>(layer | (fixed ? broad_phase::fixed_object : 0u)), group, crowd};
  }
};

/// The objects that overlap a CD node's region, as last received, packed for its sweep and narrow phase.
///
/// Threads: belongs to its CD node. Memory: grows with the number of objects.
class RegionObjects {
 public:
  static constexpr std::uint32_t none = base::NumberIndex::none;

  /// `sweeps`: store bounds, layers and resting flags for a sweep.
  RegionObjects(std::size_t objects, bool sweeps);

  std::size_t size() const noexcept { return slots_.size(); }
  /// Index of the object in a slot, or none.
  std::uint32_t find(std::uint32_t slot) const noexcept { return index_.find(slot + 1); }

  /// The same, but tries the index `was` first: the list of slots fits 16 objects in a cache line, the table by slot
  /// one.
  std::uint32_t find(std::uint32_t slot, std::uint32_t was) const noexcept {
    return was < slots_.size() && slots_[was] == slot ? was : find(slot);
  }

  /// Adds an object or replaces its values, and returns its index. `values`: a Hosted or a PositionRecord. `inner`: the
  /// bounds touch only this node's region. `was`: expected index, as in find(). `hosted`: the object's index in the
  /// node's Host, if it is hosted there.
  /// `filter()` returns the object's PairFilter; it is called only for an object that is new here: see set_filter().
  template <class Values, class Filter>
  std::uint32_t set(const Values& values, const geometry::Bounds& bounds, const Filter& filter, NextHost next,
                    bool inner, std::uint32_t was = none, std::uint32_t hosted = none) {
    const messages::ObjectRef& object = values.object;
    std::uint32_t i = find(object.slot, was);
    if (i == none) [[unlikely]] {
      i = add(object.slot);
    }
    if (bodies_[i].number != object.number) [[unlikely]] {  // otherwise the constant fields are already set
      numbers_[i] = object.number;
      set_filter(i, filter());
    }
    bodies_[i] = {values.pose,  values.shape,    object.number,   object.generation,
                  values.layer, values.category, values.user_data};
    changed_[i] = frame_;
    marks_[i] = static_cast<std::uint8_t>((inner ? inner_mark : 0) | static_cast<unsigned>(next));
    hosted_[i] = hosted;
    if (sweeps_) {
      bounds_[i] = bounds;
      resting_[i] = 0;
    }
    return i;
  }
  /// Replaces the PairFilter of the object with that index.
  void set_filter(std::uint32_t i, PairFilter filter);
  /// Prefetches what find() reads for that slot.
  void prefetch_index(std::uint32_t slot) const noexcept { index_.prefetch(slot + 1); }
  /// Prefetches the body that set() with that index writes; nothing for none. Another node may have read it in the last
  /// frame, and then a store takes longest: so call it some time before prefetch().
  void prefetch_body(std::uint32_t i) const noexcept {
    if (i < slots_.size()) base::prefetch_for_write(&bodies_[i]);
  }
  /// Prefetches what find() with that index reads, the inner flag, and most else of what set() writes; nothing for
  /// none.
  void prefetch(std::uint32_t i) const noexcept {
    if (i < slots_.size()) {
      base::prefetch_for_read(&slots_[i]);
      base::prefetch_for_write(&marks_[i]);
      base::prefetch_for_write(&hosted_[i]);
      base::prefetch_for_write(&changed_[i]);
      if (sweeps_) {
        base::prefetch_for_write(&bounds_[i]);
        base::prefetch_for_write(reinterpret_cast<const std::byte*>(&bounds_[i] + 1) - 1);
        base::prefetch_for_write(&resting_[i]);
      }
    }
  }
  /// Prefetch what slot() and hosted() read.
  void prefetch_slot(std::uint32_t i) const noexcept { base::prefetch_for_read(&slots_[i]); }
  void prefetch_hosted(std::uint32_t i) const noexcept { base::prefetch_for_read(&hosted_[i]); }
  /// Removes an object; the last one takes its index. Does nothing if the object is unknown.
  void remove(std::uint32_t slot);
  void clear() noexcept;
  /// From now on changes are those of that frame.
  void begin_frame(std::uint64_t frame) noexcept { frame_ = base::stamp_of(frame); }

  std::span<const narrow_phase::Body> bodies() const noexcept { return bodies_.span(); }
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_.span(); }
  std::span<const std::uint32_t> slots() const noexcept { return slots_.span(); }
  std::uint32_t slot(std::size_t i) const noexcept { return slots_[i]; }
  /// The last frame in which each index got its object, or set() or set_filter() was called for it.
  std::span<const base::FrameStamp> changed() const noexcept { return changed_; }
  /// As last passed to set().
  NextHost next_host(std::size_t i) const noexcept { return static_cast<NextHost>(marks_[i] & ~inner_mark); }
  /// Index of the i-th object in the node's Host at its last set(), or none.
  std::uint32_t hosted(std::size_t i) const noexcept { return hosted_[i]; }
  /// Whether set() was last called with `inner`. False is always correct, but costs time.
  bool inner(std::size_t i) const noexcept { return (marks_[i] & inner_mark) != 0; }
  /// One byte per object, which contains inner_mark.
  std::span<const std::uint8_t> marks() const noexcept { return marks_; }
  static constexpr unsigned inner_mark = 4;
  /// The value of inner() at the last call of note_inner().
  bool was_inner(std::size_t i) const noexcept { return (marks_before_[i] & inner_mark) != 0; }
  void note_inner() noexcept { std::copy(marks_.begin(), marks_.end(), marks_before_.begin()); }
  /// Number of each object; packed more densely than in bodies().
  std::span<const ObjectNumber> numbers() const noexcept { return numbers_.span(); }
  /// PairFilter::layer of each object.
  std::span<const std::uint8_t> layers() const noexcept { return layers_; }
  /// PairFilter::group of each object; empty as long as no object has had one.
  std::span<const std::uint32_t> groups() const noexcept {
    return has_groups_ ? std::span<const std::uint32_t>(groups_) : std::span<const std::uint32_t>();
  }
  /// PairFilter::crowd of each object; empty as long as no object has had one.
  std::span<const std::uint32_t> crowds() const noexcept {
    return has_crowds_ ? std::span<const std::uint32_t>(crowds_) : std::span<const std::uint32_t>();
  }

  /// One byte per object: 1 if it has not changed since the last call of settle().
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }
  /// One byte per object, all 1: objects listed here are present.
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  void settle() noexcept;

 private:
  std::uint32_t add(std::uint32_t slot);
  template <class Visit>
  void each_list(Visit visit);

  bool sweeps_;
  base::NumberIndex index_;  ///< by slot + 1, because 0 is not a number: few of a thousand nodes know an object
  base::FlatList<std::uint32_t> slots_;
  base::FlatList<narrow_phase::Body> bodies_;
  base::FlatList<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> layers_;
  std::vector<std::uint32_t> groups_;  ///< empty without has_groups_
  bool has_groups_ = false;            ///< an object had a group
  std::vector<std::uint32_t> crowds_;  ///< empty without has_crowds_
  bool has_crowds_ = false;            ///< an object had a crowd
  base::FlatList<ObjectNumber> numbers_;
  base::FlatList<base::FrameStamp> changed_;
  base::FrameStamp frame_ = 0;
  base::FlatList<std::uint32_t> hosted_;
  std::vector<std::uint8_t> marks_;  ///< NextHost, and inner_mark
  std::vector<std::uint8_t> marks_before_;
  std::vector<std::uint8_t> resting_;
  std::vector<std::uint8_t> present_;
};

}  // namespace ringfence::nodes
