#include "ringfence/ids.hpp"

#include <concepts>
#include <cstdint>
#include <type_traits>
#include <unordered_map>
#include <unordered_set>

#include <doctest/doctest.h>

#include "ringfence/world.hpp"

using namespace ringfence;

namespace {

template <class Argument>
concept finds_collisions = requires(const World& world, Argument argument) {
  world.collisions_of(argument);
};
template <class Argument>
concept finds_views = requires(const World& world, Argument argument) {
  world.seen_by(argument);
};
template <class User, class Object>
concept moves = requires(World& world, User user, Object object) {
  world.move(user, object, Pose{});
};
template <class Argument>
concept destroys = requires(World& world, Argument argument) {
  world.destroy(argument);
};
template <class Argument>
concept describes_shape = requires(const World& world, Argument argument) {
  world.shape(argument);
};
template <class Argument>
concept is_shape_of_spec = requires(ObjectSpec& spec, Argument argument) {
  spec.shape = argument;
};
template <class Argument>
concept is_node_of_fault = requires(Fault& fault, Argument argument) {
  fault.node = argument;
};

// The number of an object must not be taken for that of a user node.
static_assert(finds_collisions<ObjectId> && finds_collisions<UserId>);
static_assert(!finds_collisions<ObjectNumber> && !finds_collisions<std::uint64_t> && !finds_collisions<int>);
static_assert(!finds_collisions<NodeId> && !finds_collisions<ShapeId>);
static_assert(finds_views<UserId> && !finds_views<ObjectId> && !finds_views<std::uint32_t>);
static_assert(moves<UserId, ObjectId>);
static_assert(!moves<UserId, ObjectNumber> && !moves<std::uint32_t, ObjectId> && !moves<ObjectId, UserId>);
static_assert(destroys<ObjectId> && !destroys<ObjectNumber> && !destroys<UserId>);
static_assert(describes_shape<ShapeId> && !describes_shape<std::uint32_t> && !describes_shape<NodeId>);
static_assert(is_shape_of_spec<ShapeId> && !is_shape_of_spec<std::uint32_t> && !is_shape_of_spec<UserId>);
static_assert(is_node_of_fault<NodeId> && !is_node_of_fault<std::uint32_t> && !is_node_of_fault<UserId>);

template <class P, class Q>
constexpr bool unrelated = !std::convertible_to<P, Q> && !std::equality_comparable_with<P, Q>;
static_assert(unrelated<UserId, NodeId> && unrelated<NodeId, ShapeId> && unrelated<ShapeId, UserId>);
static_assert(unrelated<UserId, std::uint32_t> && unrelated<std::uint32_t, UserId> && unrelated<UserId, ObjectId>);

}  // namespace

TEST_CASE_TEMPLATE("an id has the number that it was made from, and is ordered by it", Id, UserId, NodeId, ShapeId) {
  static_assert(std::is_trivially_copyable_v<Id> && sizeof(Id) == sizeof(std::uint32_t));
  CHECK(Id(7).number() == 7);
  CHECK(Id(7) == Id(7));
  CHECK(Id(7) != Id(8));
  CHECK(Id(7) < Id(8));
  CHECK(Id(0xffffffffu) > Id(0));
}

TEST_CASE("the default user is no user; the default node and the default shape are those with number 0") {
  CHECK(UserId() == no_user);
  CHECK_FALSE(no_user);
  CHECK(UserId(0));
  CHECK(NodeId() == NodeId(0));
  CHECK(ShapeId() == ShapeId(0));
}

TEST_CASE_TEMPLATE("ids are keys of unordered containers", Id, UserId, NodeId, ShapeId) {
  std::unordered_set<Id> ids;
  for (std::uint32_t number = 0; number < 100; ++number) ids.insert(Id(number % 50));
  CHECK(ids.size() == 50);
  CHECK(ids.contains(Id(49)));
  CHECK_FALSE(ids.contains(Id(50)));
}

TEST_CASE("two generations of the same number are different keys of an unordered container") {
  std::unordered_map<ObjectId, int> objects = {{ObjectId::of(7, 1), 1}, {ObjectId::of(7, 2), 2}};
  CHECK(objects.at(ObjectId::of(7, 1)) == 1);
  CHECK(objects.at(ObjectId::of(7, 2)) == 2);
  CHECK_FALSE(objects.contains(ObjectId::of(7, 3)));
}
