#include "facade/requests/user_numbers.hpp"

#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

std::vector<UserNumber> list(std::span<const UserNumber> users) { return {users.begin(), users.end()}; }

TEST_CASE("the lowest free number is that of no connected user node") {
  UserNumbers users;
  CHECK(users.free_number() == 0);
  users.connect(2);
  users.connect(0);
  CHECK(users.free_number() == 1);
  users.connect(1);
  CHECK(users.free_number() == 3);
  CHECK(users.is_connected(2));
  CHECK(!users.is_connected(3));
}

TEST_CASE("the number of a disconnected user node is free when the frame that disconnects it is complete") {
  UserNumbers users;
  users.connect(0);
  users.connect(1);
  users.disconnect(0);
  CHECK(!users.is_connected(0));
  CHECK(users.in_use(0));
  users.cut();
  CHECK(list(users.cut_leaving()) == std::vector<UserNumber>{0});
  users.disconnect(1);  // while the frame is running: at the next cut
  CHECK(list(users.cut_leaving()) == std::vector<UserNumber>{0});
  CHECK(users.free_number() == 2);
  users.forget_cut();
  CHECK(!users.in_use(0));
  CHECK(users.in_use(1));
  CHECK(users.free_number() == 0);
  users.cut();
  CHECK(list(users.cut_leaving()) == std::vector<UserNumber>{1});
  users.forget_cut();
  CHECK(!users.in_use(1));
}

}  // namespace
}  // namespace ringfence::facade
