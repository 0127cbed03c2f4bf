#include "facade/results/contact_index.hpp"

#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

std::vector<Contact> random_contacts(std::mt19937& random, ObjectNumber objects, std::size_t count) {
  std::vector<Contact> contacts(count);
  for (Contact& contact : contacts) {
    contact.a = 1 + static_cast<ObjectNumber>(random() % objects);
    contact.b = contact.a + 1 + static_cast<ObjectNumber>(random() % objects);
  }
  return contacts;
}

TEST_CASE("the index finds the contacts of each object that a search finds") {
  for (std::uint32_t seed = 1; seed <= 50; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    ContactIndex index;
    for (std::uint64_t frames = 1; frames <= 3; ++frames) {
      const std::vector<Contact> contacts = random_contacts(random, 20, random() % 60);
      index.update(frames, contacts);
      for (ObjectNumber object = 1; object <= 45; ++object) {
        std::vector<std::uint32_t> expected;
        for (std::uint32_t i = 0; i < contacts.size(); ++i) {
          if (contacts[i].a == object || contacts[i].b == object) expected.push_back(i);
        }
        const auto found = index.of(object);
        REQUIRE(std::vector<std::uint32_t>(found.begin(), found.end()) == expected);
      }
    }
  }
}

TEST_CASE("the index is built once for a frame") {
  std::mt19937 random(1);
  ContactIndex index;
  CHECK(index.of(1).empty());
  index.update(1, random_contacts(random, 1, 5));
  CHECK(index.of(1).size() == 5);
  index.update(1, {});
  CHECK(index.of(1).size() == 5);
  index.update(2, {});
  CHECK(index.of(1).empty());
}

}  // namespace
}  // namespace ringfence::facade
