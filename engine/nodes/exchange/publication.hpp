#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "geometry/corner_box.hpp"
#include "link/atomics.hpp"
#include "queries/box_tree.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::nodes {

/// The state of one object that many threads read: where it is. The same layout as in the API.
using PublishedState = SeenState;

/// The states of one frame, in an order in which neighbours in space are near each other, and a tree of the boxes
/// around each few of them, a leaf: written once by one thread, then read in place by any number of threads.
///
/// Double-buffered: the last published frame and the one before it can be read. Where one thread writes and reads, the
/// last one is enough.
///
/// The frame protocol guarantees that all readers of frame k have finished before the writer begins frame k + 2, or
/// k + 1 if one frame is kept. (In lock-step they finish before the server lets frame k + 1 end.) A violation can be
/// detected: a buffer carries its frame's stamp only while it is complete, the readers' functions return nothing
/// without the stamp, and `is_intact` says whether what was read was consistent. The tests of the protocol do so.
///
/// The states are those of entries of a table, by number. Their order is kept from frame to frame, so publishing writes
/// each state once, in that order, and the boxes. Any order is correct; a good one has small boxes, so that a reader
/// lists few states that are not near. An entry that has another object than in the frame before is new: new entries
/// follow behind the others, sorted among themselves. An entry without a state leaves its leaf, which becomes smaller,
/// so that the others stay in theirs. When boxes have grown too much, all are sorted (MedianSplits), in a frame whose
/// number is a multiple of eight.
///
/// Cost: 4 ns a state and frame, and 40 to 75 ns to sort it. Readers copy nothing and write no cache line, so they do
/// not disturb each other.
///
/// Threads: one writer thread calls begin, list and publish; any thread may call const functions. Memory: 50 bytes a
/// state and kept frame, and 12 more a state; 1 MB of the thread that writes. Grows and never shrinks.
class Publication {
 public:
  /// What a writer has done with an entry.
  enum class Written : std::uint8_t {
    state,     ///< it has a state, and this is set
    nothing,   ///< it has none in this frame
    unlisted,  ///< it has none, and is not listed any more
  };

  /// Reserves memory for `states` states a frame; more may be published, at the cost of an allocation. `interest`: how
  /// far around a point most readers read, in metres. `kept_frames`: the number of frames that can be read, 1 or 2.
  Publication(std::size_t states, double interest, std::size_t kept_frames = 2);

  /// Writer: starts `frame`, which is not less than any earlier one and less than 2^64 - 1. The states of `kept_frames`
  /// frames ago are discarded. If `frame` is the current frame, it is published again from the start; no reader may
  /// have begun to read it.
  void begin(std::uint64_t frame) noexcept;

  /// Writer: an entry that is not listed is from now on.
  void list(std::uint32_t entry) {
    entries_.push_back(entry);
    numbers_.push_back(no_number);
  }
  /// Writer: from now on the entries from 0 to `size` - 1 are listed, and no others.
  void list_first(std::uint32_t size);
  /// Writer: publishes the listed entries, and makes them visible by one store. `write(entry, state)` sets the state of
  /// an entry if it has one, and returns what it has done. It is called once for an entry, twice for a new one, and
  /// `prefetch(entry)` some entries earlier.
  template <class Prefetch, class Write>
  void publish(Prefetch prefetch, Write write) {
    write_states(buffers_[current_].states, prefetch, write);
    finish();
  }
  /// Writer, after publish(): the listed entries in the order of their states; behind them those without one.
  std::span<const std::uint32_t> entries() const noexcept { return entries_.span(); }

  /// Reader: whether `frame` can be read: it is the last published frame or, if two are kept, the one before.
  bool published(std::uint64_t frame) const noexcept { return find_buffer(frame) != nullptr; }
  /// Reader: all states of a frame; none if it cannot be read.
  std::span<const PublishedState> states(std::uint64_t frame) const noexcept {
    const FrameBuffer* buffer = find_buffer(frame);
    return buffer ? buffer->states.span() : std::span<const PublishedState>();
  }
  /// Reader: where the leaves of a frame begin, then the number of states. Leaf i has the states from begins[i] to
  /// begins[i + 1] - 1. Empty if the frame cannot be read.
  std::span<const std::uint32_t> leaf_begins(std::uint64_t frame) const noexcept {
    const FrameBuffer* buffer = find_buffer(frame);
    return buffer ? buffer->leaf_begins.span() : std::span<const std::uint32_t>();
  }
  /// Reader: the tree of a frame. Its box i contains the positions of the states of leaf i. Null if the frame cannot be
  /// read.
  const queries::BoxTree* tree(std::uint64_t frame) const noexcept {
    const FrameBuffer* buffer = find_buffer(frame);
    return buffer ? &buffer->tree : nullptr;
  }
  /// Reader: prefetches what tree(), states(), leaf_begins() and bounds() read.
  void prefetch() const noexcept {
    for (const FrameBuffer& buffer : buffers_) base::prefetch_object(buffer);
  }
  /// Reader: the smallest box that contains all positions; empty if there are none.
  geometry::CornerBox bounds(std::uint64_t frame) const noexcept;
  /// Reader, after use of what it read of `frame`: whether that was consistent throughout.
  bool is_intact(std::uint64_t frame) const noexcept;

 private:
  struct alignas(link::cache_line_pair_bytes) FrameBuffer {
    std::atomic<std::uint64_t> stamp{no_stamp};  ///< the frame, while the other members are complete
    base::FlatList<PublishedState> states;
    base::FlatList<std::uint32_t> leaf_begins;
    queries::BoxTree tree;
    geometry::CornerBox bounds;
  };

  static constexpr std::uint64_t no_stamp = ~std::uint64_t{0};
  static constexpr ObjectNumber no_number = 0;
  static constexpr std::size_t leaf_size = 16;      ///< the most states in a leaf
  static constexpr std::size_t tail_leaf_size = 8;  ///< the same of new entries, which are farther from each other

  const FrameBuffer* find_buffer(std::uint64_t frame) const noexcept {
    // Pairs with the store in finish().
    for (const FrameBuffer& buffer : buffers_) {
      if (buffer.stamp.load(std::memory_order_acquire) == frame) return &buffer;
    }
    return nullptr;
  }
  std::size_t next_buffer() const noexcept { return kept_frames_ == 2 ? current_ ^ 1 : current_; }

  /// Writes the states. Closes the gaps of new entries, which follow behind the others, and of those without a state.
  template <class Prefetch, class Write>
  void write_states(base::FlatList<PublishedState>& states, Prefetch prefetch, Write write) {
    constexpr std::size_t ahead = 32;  // entries are anywhere in the table
    const std::size_t size = entries_.size();
    states.resize(size);
    new_.clear();
    absent_.clear();
    PublishedState* const to = states.data();
    std::uint32_t* const entries = entries_.data();
    ObjectNumber* const numbers = numbers_.data();
    std::size_t count = keep_entries([&](std::size_t i, std::size_t at) {
      prefetch(entries[std::min(i + ahead, size - 1)]);
      const std::uint32_t entry = entries[i];
      if (const Written written = write(entry, to[at]); written != Written::state) [[unlikely]] {
        if (written == Written::nothing) absent_.push_back(entry);
        return false;
      }
      if (to[at].number != numbers[i]) [[unlikely]] {
        new_.push_back(entry);
        return false;
      }
      return true;
    });
    for (const std::uint32_t entry : new_) {
      (void)write(entry, to[count]);
      entries[count] = entry;
      numbers[count] = to[count].number;
      ++count;
    }
    states.resize(count);
    for (const std::uint32_t entry : absent_) {
      entries[count] = entry;
      numbers[count++] = no_number;
    }
    entries_.resize(count);
    numbers_.resize(count);
  }
  /// Keeps the listed entries for which keep(i, at) returns true, in their order: entry i comes to position `at`.
  /// Leaves become smaller, and those without an entry are removed. Returns how many entries are kept.
  template <class Keep>
  std::size_t keep_entries(Keep keep) {
    std::uint32_t* const entries = entries_.data();
    ObjectNumber* const numbers = numbers_.data();
    std::uint32_t* const begins = begins_.data();
    const std::size_t leaves = begins_.size() - 1;
    std::size_t i = 0, count = 0, kept = 0, kept_sorted = 0;
    for (std::size_t leaf = 0; leaf <= leaves; ++leaf) {  // the last one is what is not sorted
      kept_sorted = leaf <= sorted_leaves_ ? kept : kept_sorted;
      const std::size_t end = leaf < leaves ? begins[leaf + 1] : entries_.size();
      begins[kept] = static_cast<std::uint32_t>(count);
      for (; i < end; ++i) {
        if (keep(i, count)) [[likely]] {
          entries[count] = entries[i];
          numbers[count] = numbers[i];
          ++count;
        }
      }
      kept += leaf < leaves && count > begins[kept] ? 1 : 0;
    }
    begins_.resize(kept + 1);
    sorted_leaves_ = kept_sorted;
    return count;
  }
  void finish();
  double set_boxes(FrameBuffer& buffer) const;
  void sort(FrameBuffer& buffer, std::size_t leaf, std::size_t size);
  void sort_states(FrameBuffer& buffer, std::size_t first);

  std::array<FrameBuffer, 2> buffers_;  ///< if one frame is kept, only the first is used
  double interest_;
  std::size_t kept_frames_;

  // Used by the writer only.
  alignas(link::cache_line_pair_bytes) std::size_t current_ = 0;  ///< the buffer that is being written, or was last
  std::uint64_t frame_ = 0;
  base::FlatList<std::uint32_t> entries_;  ///< listed, in the order of their states
  base::FlatList<ObjectNumber> numbers_;   ///< parallel: the object in the last frame; no_number: none
  /// The first entry of each leaf, then that of the entries that are not sorted.
  base::FlatList<std::uint32_t> begins_;
  std::size_t sorted_leaves_ = 0;  ///< so many leaves were sorted together; those that follow them too
  double sorted_cost_ = 0;         ///< as set_boxes(), by state, when all were sorted
  std::uint64_t sorted_frame_ = 0;
  std::vector<std::uint32_t> new_;  ///< entries; then the order of what is sorted
  std::vector<std::uint32_t> absent_;
};

}  // namespace ringfence::nodes
