#include "nodes/exchange/sender_set.hpp"

#include <vector>

#include <doctest/doctest.h>

namespace ringfence::nodes::test {
namespace {

using Slots = std::vector<NodeNumber>;

Slots taken(SenderSet& set) {
  Slots slots;
  set.take([&](NodeNumber slot) { slots.push_back(slot); });
  return slots;
}

TEST_CASE("the senders that were added are taken once, by ascending slot") {
  SenderSet set;
  CHECK(taken(set).empty());
  for (const NodeNumber sender : {1023u, 64u, 0u, 63u, 64u}) {
    set.add(sender);
  }
  CHECK(taken(set) == Slots{0, 63, 64, 1023});
  CHECK(taken(set).empty());
  set.add(63);
  CHECK(taken(set) == Slots{63});
}

}  // namespace
}  // namespace ringfence::nodes::test
