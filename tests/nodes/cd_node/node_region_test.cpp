#include "nodes/cd_node/node_region.hpp"

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

std::vector<messages::OwnerRecord> all_cells_of(NodeNumber owner) {
  return std::vector<messages::OwnerRecord>(64, messages::OwnerRecord{owner, 0});
}
std::span<const messages::OwnerRecord> part(const std::vector<messages::OwnerRecord>& all, std::size_t from,
                                            std::size_t count) {
  return std::span<const messages::OwnerRecord>(all).subspan(from, count);
}

TEST_CASE("a new map counts when its last part arrives") {
  NodeFixture fixture;
  NodeRegion& region = fixture.state().region;
  const auto owners = all_cells_of(1);
  CHECK(region.contains({10, 10, 10}));
  CHECK(!region.contains({40, 10, 10}));
  CHECK(!region.receive(fixture.message(MessageType::region_map, part(owners, 0, 30), false)));
  CHECK(region.contains({10, 10, 10}));
  CHECK(!region.take_change());
  CHECK(region.receive(fixture.message(MessageType::region_map, part(owners, 30, 34))));
  CHECK(!region.contains({10, 10, 10}));
  CHECK(region.owner_at({10, 10, 10}) == 1);
  CHECK(region.coverage(fixture.bounds({10, 10, 10})) == regions::Coverage::none);
  CHECK(region.take_change());
  CHECK(!region.take_change());
}

TEST_CASE("bounds within the region touch no other one") {
  NodeFixture fixture;
  const NodeRegion& region = fixture.state().region;
  CHECK(region.coverage(fixture.bounds({30, 10, 10})) == regions::Coverage::all);
  CHECK(region.coverage(fixture.bounds({31.8, 10, 10})) == regions::Coverage::part);
  CHECK(region.coverage(fixture.bounds({34, 10, 10})) == regions::Coverage::none);
}

TEST_CASE("a map with an owner without a slot, too few entries or half a cut is not acceptable") {
  NodeFixture fixture;
  NodeRegion& region = fixture.state().region;
  CHECK(region.is_acceptable(fixture.message(MessageType::region_map, part(all_cells_of(1), 0, 64))));
  CHECK(!region.is_acceptable(fixture.message(MessageType::region_map, part(all_cells_of(2), 0, 64))));
  CHECK(!region.is_acceptable(fixture.message(MessageType::region_map, part(all_cells_of(1), 0, 63))));
  const auto first = fixture.message(MessageType::region_map, part(all_cells_of(1), 0, 40), false);
  region.receive(first);
  CHECK(!region.is_acceptable(fixture.message(MessageType::region_map, part(all_cells_of(1), 0, 25))));
  region.discard_entries();
  CHECK(region.is_acceptable(fixture.message(MessageType::region_map, part(all_cells_of(1), 0, 64))));
}

TEST_CASE("a map fits if all its owners have a slot") {
  NodeFixture fixture;
  NodeRegion& region = fixture.state().region;
  CHECK(region.fits());
  region.assign(0, 1);
  CHECK(!region.fits());
  CHECK(region.receive(fixture.message(MessageType::region_map, part(all_cells_of(0), 0, 64))));
  CHECK(region.fits());
}

}  // namespace
}  // namespace ringfence::nodes::test
