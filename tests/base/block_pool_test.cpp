#include "base/block_pool.hpp"

#include <cstddef>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::base {
namespace {

struct alignas(256) Counted {
  explicit Counted(int& counter, bool fails = false) : living(counter) {
    if (fails) throw std::runtime_error("refused");
    ++living;
  }
  ~Counted() { --living; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  int& living;
};

std::byte* place_of(const std::shared_ptr<Counted>& object) { return reinterpret_cast<std::byte*>(object.get()); }

TEST_CASE("the expected objects of a pool lie side by side, and further ones are made too") {
  for (const std::size_t expected : {1u, 5u, 6000u}) {  // 6000 have memory from the system
    int living = 0;
    {
      BlockPool<Counted> pool;
      std::vector<std::shared_ptr<Counted>> objects;
      for (std::size_t i = 0; i < expected + 3; ++i) objects.push_back(pool.make(expected, living));
      CHECK(living == static_cast<int>(expected) + 3);
      for (std::size_t i = 0; i < expected; ++i) {
        REQUIRE(place_of(objects[i]) == place_of(objects[0]) + i * sizeof(Counted));
      }
      std::set<std::uintptr_t> places;
      for (const auto& object : objects) {
        const auto place = reinterpret_cast<std::uintptr_t>(object.get());
        REQUIRE(place % alignof(Counted) == 0);
        places.insert(place / sizeof(Counted));
      }
      CHECK(places.size() == objects.size());
    }
    CHECK(living == 0);
  }
}

TEST_CASE("a pool uses the place of an object again that has ended, or was not made") {
  int living = 0;
  BlockPool<Counted> pool;
  auto first = pool.make(2, living);
  auto second = pool.make(2, living);
  std::byte* const place = place_of(first);
  first.reset();
  CHECK(living == 1);
  CHECK_THROWS(pool.make(2, living, true));
  CHECK(living == 1);
  first = pool.make(2, living);
  CHECK(place_of(first) == place);
  CHECK(place_of(second) == place + sizeof(Counted));
}

TEST_CASE("the objects of a pool may outlive it") {
  int living = 0;
  std::shared_ptr<Counted> object;
  {
    BlockPool<Counted> pool;
    object = pool.make(3, living);
    pool.make(3, living).reset();
  }
  CHECK(living == 1);
  object.reset();
  CHECK(living == 0);
}

}  // namespace
}  // namespace ringfence::base
