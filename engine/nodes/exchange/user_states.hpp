#pragma once

#include <cstdint>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "nodes/exchange/publication.hpp"

namespace ringfence::nodes {

/// The states that the user nodes of a thread publish, one user node after another: the table of which a Publication
/// has the entries. An object has the same number in each frame, unless user nodes or objects before it come or go;
/// then it counts as new there, which costs up to 75 ns.
///
/// Threads: belongs to the thread that steps the user nodes. Memory: 52 bytes a state, kept.
class UserStates {
 public:
  std::uint32_t size() const noexcept { return static_cast<std::uint32_t>(states_.size()); }
  void clear() noexcept { states_.clear(); }
  /// Adds an object that is present, or one that is not and has no state.
  void add(const PublishedState& state) { states_.push_back(state); }
  void add_absent() { states_.add().flags = absent_flag; }

  /// Publishes all, in a frame that has begun.
  void publish(Publication& publication) {
    publication.list_first(size());
    publication.publish([this](std::uint32_t i) { base::prefetch_for_read(&states_[i]); },
                        [this](std::uint32_t i, PublishedState& to) {
                          to = states_[i];
                          return to.flags != absent_flag ? Publication::Written::state : Publication::Written::nothing;
                        });
    places_.resize(states_.size());
    const auto entries = publication.entries();
    for (std::uint32_t place = 0; place < entries.size(); ++place) places_[entries[place]] = place;
  }
  /// After publish(): the position in the publication of the object that was added as number `added`, from 0; behind
  /// all states if it has none.
  std::uint32_t place_of(std::uint32_t added) const noexcept { return places_[added]; }

 private:
  static constexpr std::uint32_t absent_flag = 1;

  base::FlatList<PublishedState> states_;
  base::FlatList<std::uint32_t> places_;
};

}  // namespace ringfence::nodes
