#include "nodes/cd_node/halo_exchange.hpp"

#include <bit>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

using messages::flag_present;

std::vector<std::pair<ObjectNumber, bool>> updates_for(const NodeState& state, NodeNumber peer) {
  base::FlatList<GhostUpdates::Update> list;
  state.contacts.ghost_updates.list(peer, list);
  std::vector<std::pair<ObjectNumber, bool>> numbers;
  for (const GhostUpdates::Update& update : list) {
    numbers.emplace_back(update.record->object.number, update.gone);
  }
  return numbers;
}

using Updates = std::vector<std::pair<ObjectNumber, bool>>;

TEST_CASE("a hosted object is sent to the peer whose region its bounds touch, and to no other node") {
  NodeFixture fixture;
  HaloExchange halo(fixture.state());
  halo.assign();
  const std::uint32_t at_border = fixture.host(1, {31.8, 10, 10});
  const std::uint32_t inside = fixture.host(2, {20, 10, 10});
  halo.begin();
  halo.add_updates(at_border, fixture.bounds({31.8, 10, 10}), true, RegionObjects::none);
  halo.add_updates(inside, fixture.bounds({20, 10, 10}), true, RegionObjects::none);
  fixture.state().contacts.ghost_updates.finish(2);
  CHECK(updates_for(fixture.state(), 1) == Updates{{1, false}});
  CHECK(updates_for(fixture.state(), 0).empty());
}

TEST_CASE("a peer receives a removal when an object leaves its region") {
  NodeFixture fixture;
  HaloExchange halo(fixture.state());
  halo.assign();
  const std::uint32_t hosted = fixture.host(1, {28, 10, 10});
  fixture.know(1, {31.8, 10, 10});
  halo.begin();
  halo.add_updates(hosted, fixture.bounds({28, 10, 10}), true, fixture.state().objects.find(1));
  fixture.state().contacts.ghost_updates.finish(2);
  CHECK(updates_for(fixture.state(), 1) == Updates{{1, true}});
}

TEST_CASE("the next host of an object follows from its position and flags") {
  NodeFixture fixture;
  const RegionObjects& objects = fixture.state().objects;
  fixture.know(1, {10, 10, 10}, flag_present | messages::flag_avatar);
  fixture.know(2, {12, 10, 10}, flag_present | messages::flag_fixed);
  fixture.know(3, {14, 10, 10});
  fixture.know(4, {31.8, 10, 10});
  fixture.know(5, {32.2, 10, 10});
  const auto next_of = [&](std::uint32_t slot) { return objects.next_host(objects.find(slot)); };
  CHECK(next_of(1) == NextHost::user);
  CHECK(next_of(2) == NextHost::none);
  CHECK(next_of(3) == NextHost::self);
  CHECK(next_of(4) == NextHost::self);
  CHECK(next_of(5) == NextHost::node);
  CHECK(objects.inner(objects.find(3)));
  CHECK(!objects.inner(objects.find(4)));
  CHECK(!fixture.state().received.positions);  // a word says that no more follow
  fixture.know(3, {14, 10, 10}, messages::flag_left_region);
  CHECK(objects.find(3) == RegionObjects::none);
}

TEST_CASE("after a new map nothing is known of the region, and hosts that exchange objects list all of them") {
  NodeFixture fixture({.shares_memory = false});
  NodeState& state = fixture.state();
  HaloExchange halo(state);
  fixture.know(1, {10, 10, 10});
  fixture.host(2, {10, 20, 10});
  state.stage = CdNodeStage::ending;
  const std::vector<messages::OwnerRecord> owners(64, messages::OwnerRecord{0, 0});
  const std::span<const messages::OwnerRecord> all(owners);
  halo.receive_map(fixture.message(MessageType::region_map, all.first(10), false));
  CHECK(state.objects.size() == 1);
  halo.receive_map(fixture.message(MessageType::region_map, all.subspan(10)));
  CHECK(state.objects.size() == 0);
  CHECK(state.region.contains({60, 10, 10}));
  state.host.list_all(true);  // as frame_end requests
  state.host.move(2);
  CHECK(state.host.changed().size() == 1);
}

TEST_CASE("a node that shares memory copies the map of which it receives the address") {
  NodeFixture fixture;
  NodeState& state = fixture.state();
  HaloExchange halo(state);
  fixture.know(1, {10, 10, 10});
  regions::RegionMap map = state.region.map();
  map.assign(std::vector<std::uint32_t>(64, 0), 2, map.epoch() + 1);
  const regions::RegionMap* const address = &map;
  halo.receive_map(fixture.message(MessageType::region_map, std::bit_cast<messages::OwnerRecord>(address)));
  CHECK(state.objects.size() == 0);
  CHECK(state.region.contains({60, 10, 10}));
  CHECK(state.region.map().epoch() == map.epoch());
  CHECK(state.region.map().table().data() == map.table().data());
}

}  // namespace
}  // namespace ringfence::nodes::test
