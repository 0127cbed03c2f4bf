#pragma once

#include <span>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/pair_sort.hpp"
#include "base/prefetch.hpp"
#include "geometry/bounds.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/node_contacts.hpp"

namespace ringfence::nodes {

/// Adds hits to the lists of a frame. Keeps the kernels' output, a quarter of a contact; the rest are poses, which are
/// added where the contact is read in order. For the node's own model the contact is assembled at once, because the
/// bodies will have moved when the model reads it in the next frame.
///
/// Threads: belongs to the CD node. Valid as long as its arguments, until an object is added to or removed from the
/// region. Memory: the lists grow to the largest frame.
class HitWriter {
 public:
  HitWriter(NodeState& state, base::FlatList<geometry::CandidatePair>& hits,
            base::FlatList<narrow_phase::PairContact>& touches, base::PairSort& order)
      : state_(state),
        hits_(hits),
        touches_(touches),
        order_(order),
        numbers_(state.objects.numbers()),
        bodies_(state.objects.bodies()),
        keeps_(state.keeps_contacts()) {}

  void add(const narrow_phase::PairContact& touch, const geometry::CandidatePair& pair) {
    touches_.push_back(touch);
    hits_.push_back(pair);
    base::prefetch_for_write(touches_.end() + 64);  // another node may have read them in the last frame
    base::prefetch_for_write(hits_.end() + 32);
    order_.add(numbers_[pair.a], numbers_[pair.b]);
    if (keeps_) {
      NodeContacts::assemble(touch, bodies_[pair.a], bodies_[pair.b], Phase::persist,
                             state_.host.contacts().add_own(state_.frame));
    }
  }

 private:
  NodeState& state_;
  base::FlatList<geometry::CandidatePair>& hits_;
  base::FlatList<narrow_phase::PairContact>& touches_;
  base::PairSort& order_;
  std::span<const ObjectNumber> numbers_;
  std::span<const narrow_phase::Body> bodies_;
  bool keeps_;
};

}  // namespace ringfence::nodes
