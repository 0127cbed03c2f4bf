#include "nodes/exchange/user_index.hpp"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::nodes {
namespace {

TEST_CASE("each cell with states of a user is listed once, or its user as one of few with many cells") {
  std::mt19937 engine(5);
  const auto random = [&] { return static_cast<std::uint32_t>(engine()); };
  const geometry::FixedSpace space({0, 0, 0}, {64, 64, 64});
  Publications all{.grid = {{3, 3, 2}}, .space = &space, .server = {}, .relays = {}, .users = {}, .user_index = {}};
  constexpr UserNumber users = 200;
  std::vector<std::unique_ptr<link::Publication>> publications;
  std::vector<UserNumber> connected;
  all.users.resize(users);
  for (UserNumber user = 0; user < users; ++user) {
    publications.push_back(std::make_unique<link::Publication>(all.grid.cells(), 4));
    if (random() % 10 == 0) continue;  // not connected
    connected.push_back(user);
    if (random() % 20 != 0) all.users[user].publication = publications[user].get();  // else it is late
  }
  UserIndexer indexer;
  std::uniform_real_distribution<double> within(0, 64);
  for (std::uint64_t frame = 0; frame < 20; ++frame) {
    std::set<std::pair<std::uint32_t, UserNumber>> expected;
    std::vector<std::set<std::uint32_t>> cells(users);
    for (const UserNumber user : connected) {
      Published& own = all.users[user];
      if (own.publication == nullptr) continue;
      PublicationWriter writer(all, own, frame);
      const std::uint32_t states = frame % 2 == 0 && random() % 2 == 0 ? random() % 40 : random() % 3;
      for (std::uint32_t i = 0; i < states; ++i) {
        const Vec3d at{within(engine), within(engine), within(engine)};
        std::uint32_t point[3];
        space.point(at, point);
        cells[user].insert(all.grid.cell_of(point));
        writer.add(i + 1, Pose{at, {}});
      }
      writer.publish();
      for (const std::uint32_t cell : cells[user]) expected.insert({cell, user});
    }
    indexer.list(all, connected, frame);
    const UserIndex& index = all.user_index[frame & 1];
    CHECK(index.wide.size() <= 64);
    for (const UserNumber user : index.wide) {
      CHECK(cells[user].size() > 8);
      for (const std::uint32_t cell : cells[user]) CHECK(expected.erase({cell, user}) == 1);
    }
    CHECK(std::is_sorted(index.entries.begin(), index.entries.end()));
    REQUIRE(index.entries.size() == expected.size());
    for (std::uint32_t cell = 0; cell < all.grid.cells(); ++cell) {
      CHECK(index.find(cell) ==
            static_cast<std::size_t>(std::distance(expected.begin(), expected.lower_bound({cell, 0}))));
    }
    auto next = expected.begin();
    for (const std::uint64_t entry : index.entries) {
      CHECK(std::pair(UserIndex::cell_of(entry), UserIndex::user_of(entry)) == *next++);
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes
