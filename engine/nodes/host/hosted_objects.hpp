#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/flat_list.hpp"
#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "ringfence/object.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// A hosted object: S(k) without the model's state.
struct Hosted {
  messages::ObjectRef object;  ///< flags: flag_present, flag_host_owned, flag_jumped, and those in no message
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};

/// The objects that one role hosts, with the states of the motion model, packed in arrays.
///
/// Threads: belongs to its role. Memory: grows with the hosted objects.
class HostedObjects {
 public:
  /// Reserves for `objects` objects with `state_bytes` bytes of model state each, a multiple of 8.
  HostedObjects(std::size_t objects, std::size_t state_bytes);

  std::size_t size() const noexcept { return hosted_.size(); }
  const Hosted& operator[](std::size_t i) const noexcept { return hosted_[i]; }
  /// The model's state of hosted object i: state_bytes() bytes.
  const std::byte* state(std::size_t i) const noexcept { return states_.data() + i * state_bytes_; }
  /// The model's state_bytes() rounded up to 8, as in messages.
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// Index of a hosted object, or base::NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }
  /// As find(), but tries the index `was` first.
  std::uint32_t find(ObjectNumber number, std::uint32_t was) const noexcept {
    return was < numbers_.size() && numbers_[was] == number ? was : index_.find(number);
  }
  /// Prefetches what that find() reads.
  void prefetch_number(ObjectNumber number, std::uint32_t was) const noexcept {
    if (was < numbers_.size()) {
      base::prefetch_for_read(&numbers_[was]);
    } else {
      index_.prefetch(number);
    }
  }

  /// Position of hosted object i in a list of the role, as last set by the role; base::NumberIndex::none after its
  /// adoption.
  std::uint32_t place_in_list(std::size_t i) const noexcept { return places_in_list_[i]; }
  void set_place_in_list(std::size_t i, std::uint32_t place) noexcept { places_in_list_[i] = place; }

  /// ObjectSpec::group of hosted object i.
  std::uint32_t group(std::size_t i) const noexcept { return groups_.empty() ? 0 : groups_[i]; }

  /// Takes over an object with its whole state, and replaces an object of the same number. `state` points to
  /// state_bytes() bytes. The protocol hands an object over once, and the server's message comes after that of any
  /// peer, so the last record is right.
  void adopt(const messages::HandOverRecord& record, const std::byte* state);
  /// Removes an object. The last object takes its index. Does nothing if the object is not hosted.
  void drop(ObjectNumber number);
  /// Sets or clears flag_host_owned of hosted object i. While it is set, the server reads the object's states in shared
  /// memory or receives them as `replica`. place() and steer() clear it too.
  void set_host_owned(std::size_t i, bool host_owned) noexcept {
    std::uint32_t& flags = hosted_[i].object.flags;
    flags = (flags & ~messages::flag_host_owned) | (host_owned ? messages::flag_host_owned : 0u);
  }
  /// Prefetches the place of the first hosted object.
  void prefetch_first() const noexcept {
    base::prefetch_for_read(hosted_.data());
    base::prefetch_for_read(hosted_.data() + 1);
  }
  /// Both prefetch an object that is handed over soon: first what find() reads, then the object. At the end of a frame
  /// neither is in the cache. So call prefetch_index() for all such objects, and only then prefetch_leaver() for all.
  void prefetch_index(ObjectNumber number) const noexcept { index_.prefetch(number); }
  void prefetch_leaver(ObjectNumber number) const noexcept;
  /// The record for the next host.
  messages::HandOverRecord hand_over(std::size_t i) const noexcept;
  /// Sets pose and presence. The next move continues from there. Returns false if the object is not hosted.
  bool place(ObjectNumber number, const Pose& pose, bool present);
  /// Adopts the objects of a `hand_over` message.
  void adopt(const messages::MessageView& message);
  /// Applies a message of type adopt, drop or place from the server. Returns false for any other type. Hand-overs come
  /// from CD nodes, and their receiver applies them with adopt().
  bool apply(const messages::MessageView& message);

 protected:
  std::size_t state_bytes_;
  base::FlatList<Hosted> hosted_;
  base::FlatList<ObjectNumber> numbers_;  ///< of each hosted object; 16 fit a cache line
  base::FlatList<std::byte> states_;
  std::vector<std::uint8_t> touched_;  ///< by hosted object: it differs, or was placed since the last move
  base::FlatList<std::uint32_t> places_in_list_;
  base::FlatList<std::uint32_t> groups_;  ///< empty as long as no hosted object has had a group
  base::NumberIndex index_;

 private:
  template <class Visit>
  void each_list(Visit visit);
  void add_group(std::uint32_t group);
};

}  // namespace ringfence::nodes
