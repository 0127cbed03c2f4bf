#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"

namespace ringfence::facade {

/// The objects known to the caller: answers calls at once, also while a frame is running.
///
/// Threads: belongs to the thread that calls World.
class Registry {
 public:
  struct Entry {
    ObjectId id;
    Category category = Category::active;
    UserNumber user = no_user_number;
    ShapeNumber shape = 0;  ///< from the next cut on
    bool ending = false;    ///< destroyed, but its number stays in use until the next cut
  };

  explicit Registry(std::size_t objects) : index_(objects) { entries_.reserve(objects); }

  std::size_t live() const noexcept { return index_.size(); }
  bool in_use(ObjectNumber number) const noexcept { return index_.find(number) != base::NumberIndex::none; }

  /// Number of live avatars of a user.
  std::size_t avatars(UserNumber user) const noexcept { return user < avatars_.size() ? avatars_[user].size() : 0; }

  /// The next unused number after the last one that was taken; 0 if there is none.
  ObjectNumber free_number() const noexcept {
    ObjectNumber number = last_number_;
    for (std::uint64_t tries = 0; tries <= index_.size(); ++tries) {
      if (++number == 0) {
        number = 1;
      }
      if (!in_use(number)) {
        return number;
      }
    }
    return 0;
  }
  /// free_number() continues after this number.
  void take_number(ObjectNumber number) noexcept { last_number_ = number; }

  /// Precondition: the number is not 0 and not in use.
  ObjectId add(ObjectNumber number, Category category, UserNumber user, ShapeNumber shape) {
    if (++generation_ == 0) {
      generation_ = 1;
    }
    const ObjectId id = ObjectId::of(number, generation_);
    restore(id, category, user, shape);
    return id;
  }
  /// Adds an object whose id is given: of a save. The same precondition.
  void restore(ObjectId id, Category category, UserNumber user, ShapeNumber shape) {
    index_.set(id.number(), static_cast<std::uint32_t>(entries_.size()));
    entries_.push_back({id, category, user, shape, false});
    use(shape);
    if (user != no_user_number) {
      avatars_.resize(std::max<std::size_t>(avatars_.size(), user + std::size_t{1}));
      avatars_[user].push_back(id.number());
    }
  }
  /// The last number that was taken, and the generation of the last object; 0 at first.
  ObjectNumber last_number() const noexcept { return last_number_; }
  std::uint32_t generation() const noexcept { return generation_; }
  /// Sets both: numbers and generations continue from there.
  void restore_ids(ObjectNumber last_number, std::uint32_t generation) noexcept {
    last_number_ = last_number;
    generation_ = generation;
  }

  /// The entry of a live object; null if the id is null, stale, or the object is ending.
  const Entry* find(ObjectId id) const noexcept {
    const std::uint32_t at = id ? index_.find(id.number()) : base::NumberIndex::none;
    const bool live = at != base::NumberIndex::none && entries_[at].id == id && !entries_[at].ending;
    return live ? &entries_[at] : nullptr;
  }
  ObjectId find(ObjectNumber number) const noexcept {
    const std::uint32_t at = number != 0 ? index_.find(number) : base::NumberIndex::none;
    return at == base::NumberIndex::none || entries_[at].ending ? ObjectId{} : entries_[at].id;
  }

  /// Changes the shape of an object from the next cut on. Precondition: find(id) is not null.
  void set_shape(ObjectId id, ShapeNumber shape) {
    Entry& entry = entries_[index_.find(id.number())];
    released_shapes_.push_back(std::exchange(entry.shape, shape));
    use(shape);
  }
  /// Whether an object has the shape, or will have it at the next cut.
  bool uses(ShapeNumber shape) const noexcept { return shape < shape_uses_.size() && shape_uses_[shape] != 0; }

  /// Makes the id stale. The number is free when the frame that applies the end is complete. Precondition: find(id) is
  /// not null.
  void end(ObjectId id) { end(entries_[index_.find(id.number())]); }
  /// Ends all avatars of a user.
  void end_avatars(UserNumber user) {
    while (avatars(user) != 0) {
      end(entries_[index_.find(avatars_[user].back())]);
    }
  }
  /// A frame begins: its cut applies all ends so far.
  void cut() {
    cut_.swap(ended_);
    ended_.clear();
    cut_shapes_.swap(released_shapes_);
    released_shapes_.clear();
  }
  /// The frame is complete: the numbers that its cut ended may be reused.
  void forget_cut() {
    for (const ObjectNumber number : cut_) {
      const std::uint32_t at = index_.find(number);
      --shape_uses_[entries_[at].shape];
      index_.erase(number);
      if (at + 1 != entries_.size()) {
        entries_[at] = entries_.back();
        index_.set(entries_[at].id.number(), at);
      }
      entries_.pop_back();
    }
    cut_.clear();
    for (const ShapeNumber shape : cut_shapes_) {
      --shape_uses_[shape];
    }
    cut_shapes_.clear();
  }

 private:
  void use(ShapeNumber shape) {
    shape_uses_.resize(std::max<std::size_t>(shape_uses_.size(), shape + std::size_t{1}));
    ++shape_uses_[shape];
  }
  void end(Entry& entry) {
    entry.ending = true;
    ended_.push_back(entry.id.number());
    if (entry.user != no_user_number) {
      std::vector<ObjectNumber>& avatars = avatars_[entry.user];
      *std::find(avatars.rbegin(), avatars.rend(), entry.id.number()) = avatars.back();
      avatars.pop_back();
    }
  }

  base::NumberIndex index_;
  std::vector<Entry> entries_;
  std::vector<std::vector<ObjectNumber>> avatars_;  ///< alive, by user
  std::vector<ObjectNumber> ended_;                 ///< since the last cut
  std::vector<ObjectNumber> cut_;                   ///< by the cut of the running frame
  std::vector<std::uint32_t> shape_uses_;           ///< by shape: of objects, and of the next two lists
  std::vector<ShapeNumber> released_shapes_;        ///< by set_shape() since the last cut
  std::vector<ShapeNumber> cut_shapes_;             ///< at the cut of the running frame
  ObjectNumber last_number_ = 0;
  std::uint32_t generation_ = 0;
};

}  // namespace ringfence::facade
