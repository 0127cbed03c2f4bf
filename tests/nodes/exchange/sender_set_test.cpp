#include "nodes/exchange/sender_set.hpp"

#include <vector>

#include <doctest/doctest.h>

#include "link/doorbell.hpp"
#include "nodes/exchange/arrivals.hpp"

namespace ringfence::nodes::test {
namespace {

using Slots = std::vector<NodeNumber>;

template <class Set>
Slots taken(Set& set) {
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

TEST_CASE("the server finds each node that has sent something, whether or not it has ended a stage") {
  link::Doorbell bell;
  Arrivals arrivals(bell);
  arrivals.expect({7, 1});
  arrivals.note(1);
  arrivals.arrive(1, Arrivals::Stage::moved);
  arrivals.note(64);
  arrivals.wake();
  CHECK(taken(arrivals) == Slots{1, 64});
  CHECK(taken(arrivals).empty());
}

}  // namespace
}  // namespace ringfence::nodes::test
