#include "ringfence/object_contacts.hpp"

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <ranges>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/world.hpp"

using namespace ringfence;

static_assert(std::ranges::random_access_range<ObjectContacts> && std::ranges::sized_range<ObjectContacts>);
static_assert(std::ranges::view<ObjectContacts> && std::ranges::borrowed_range<ObjectContacts>);
static_assert(std::ranges::common_range<ObjectContacts>);
static_assert(std::same_as<std::ranges::range_reference_t<ObjectContacts>, const Contact&>);

TEST_CASE("the contacts of an object are those at its indices, in that order, forwards, backwards and by index") {
  std::vector<Contact> all(20);
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i].a = i;
  const std::vector<std::uint32_t> indices = {1, 4, 5, 17, 19};
  const ObjectContacts contacts(all.data(), indices);
  CHECK(contacts.size() == 5);
  CHECK_FALSE(contacts.empty());

  std::vector<std::uint32_t> forwards, backwards, by_index;
  for (const Contact& contact : contacts) forwards.push_back(contact.a);
  CHECK(forwards == indices);
  for (auto at = contacts.end(); at != contacts.begin();) backwards.push_back((--at)->a);
  CHECK(std::equal(backwards.rbegin(), backwards.rend(), indices.begin(), indices.end()));
  for (std::size_t i = 0; i < contacts.size(); ++i) by_index.push_back(contacts[i].a);
  CHECK(by_index == indices);

  const auto first = contacts.begin();
  CHECK(contacts.end() - first == 5);
  CHECK(first[3].a == 17);
  CHECK((first + 2)->a == 5);
  CHECK((contacts.end() - 1)->a == 19);
  CHECK(first < contacts.end());
  CHECK(&*first == &all[1]);
  CHECK(contacts.front().a == 1);
  CHECK(contacts.back().a == 19);
  CHECK(std::ranges::lower_bound(contacts, 6u, {}, &Contact::a)->a == 17);
}

TEST_CASE("an object without contacts has an empty range") {
  const ObjectContacts none;
  CHECK(none.empty());
  CHECK(none.begin() == none.end());
  CHECK(std::ranges::distance(none) == 0);
}

TEST_CASE("a loop over the collisions of an object visits each of them") {
  WorldConfig config;
  config.nodes = 0;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  const ObjectId middle = world.spawn({.number = 5, .shape = ball, .pose = {{50, 50, 50}, {}}}).id;
  REQUIRE(world.spawn({.number = 3, .shape = ball, .pose = {{51, 50, 50}, {}}}).status == Status::ok);
  REQUIRE(world.spawn({.number = 9, .shape = ball, .pose = {{49, 50, 50}, {}}}).status == Status::ok);
  REQUIRE(world.spawn({.number = 2, .shape = ball, .pose = {{53, 50, 50}, {}}}).status == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  std::vector<ObjectNumber> others;
  for (const Contact& contact : world.collisions_of(middle)) others.push_back(contact.a + contact.b - 5);
  CHECK(others == std::vector<ObjectNumber>{3, 9});
}
