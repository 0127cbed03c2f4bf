#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "ringfence/ids.hpp"

namespace ringfence::reference {

/// A pair of objects, and the bounds of its depth: the engine's depth is between the two. `most` below 0: the two are
/// not in contact; `least` below 0: perhaps they are not.
struct DepthBounds {
  ObjectNumber a = 0;  ///< below b
  ObjectNumber b = 0;
  double least = 0;  ///< metres
  double most = 0;
};

/// Which contacts may be in a list that has the `limit` deepest of each object (WorldConfig::deepest_contacts), and
/// which must be, where depths are known only within bounds. By definition: each object sorts all its pairs.
class DepthRanks {
 public:
  /// `pairs`: each pair that may be in contact, once. `limit` is at least 1.
  DepthRanks(std::span<const DepthBounds> pairs, std::size_t limit);
  /// Whether the pair is possibly among the deepest of one of its objects, if it is in contact.
  bool may_be_listed(const DepthBounds& pair) const;
  /// Whether the pair is among the deepest of one of its objects for all depths within the bounds, if it is in contact.
  bool must_be_listed(const DepthBounds& pair) const;

 private:
  using Rank = std::tuple<double, ObjectNumber, ObjectNumber>;  ///< minus the depth, a, b
  /// The pairs of one object, ascending.
  struct Ranks {
    std::vector<Rank> by_least, by_most;
  };

  std::size_t limit_;
  std::map<ObjectNumber, Ranks> ranks_;
};

}  // namespace ringfence::reference
