// collide and distance, the functions that need no World.
#include "ringfence/collide.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "base/caller_environment.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  float size(double low, double high) { return static_cast<float>(uniform(low, high)); }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  Vec3d direction() {
    for (;;) {
      const double x = uniform(-1, 1), y = uniform(-1, 1), z = uniform(-1, 1);
      const double length = std::sqrt(x * x + y * y + z * z);
      if (length > 0.1 && length < 1) return {x / length, y / length, z / length};
    }
  }
  Quat orientation() {
    const Vec3d v = direction();
    const double half = uniform(-3.1, 3.1), s = std::sin(half);
    return {static_cast<float>(v.x * s), static_cast<float>(v.y * s), static_cast<float>(v.z * s),
            static_cast<float>(std::cos(half))};
  }

 private:
  std::mt19937_64 engine_;
};

std::vector<Vec3f> corners(float h) {
  std::vector<Vec3f> out;
  for (int i = 0; i < 8; ++i) out.push_back({i & 1 ? h : -h, i & 2 ? h : -h, i & 4 ? h : -h});
  return out;
}

TriangleMesh box_mesh(float h) {
  return {corners(h),
          {0, 1, 3, 0, 3, 2, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 3, 7, 1, 7, 5}};
}

/// A shape that reaches `h` metres in the directions of its axes, so that two of them can be placed to touch exactly.
ShapeDescription straight_shape(ShapeKind kind, float h) {
  switch (kind) {
    case ShapeKind::sphere:
      return Sphere{h};
    case ShapeKind::box:
      return Box{{h, h, h}};
    case ShapeKind::capsule:
      return Capsule{h, h};
    case ShapeKind::hull:
      return ConvexHull{corners(h)};
    case ShapeKind::mesh:
      return box_mesh(h);
    default:
      return SupportShape{std::make_shared<Ellipsoid>(Vec3f{h, h, h})};
  }
}

ShapeDescription random_shape(ShapeKind kind, Random& random) {
  switch (kind) {
    case ShapeKind::sphere:
      return Sphere{random.size(0.3, 1.5)};
    case ShapeKind::box: {
      const float x = random.size(0.2, 1.2), y = random.size(0.2, 1.2), z = random.size(0.2, 1.2);
      return Box{{x, y, z}};
    }
    case ShapeKind::capsule: {
      const float radius = random.size(0.2, 0.8), height = random.size(0.1, 1.5);
      return Capsule{radius, height};
    }
    case ShapeKind::support: {
      const float x = random.size(0.4, 1.2), y = random.size(0.4, 1.2), z = random.size(0.4, 1.2);
      return SupportShape{std::make_shared<Ellipsoid>(Vec3f{x, y, z})};
    }
    default:
      break;
  }
  std::vector<Vec3f> points = corners(1);
  for (Vec3f& p : points) p = {p.x * random.size(0.4, 1.1), p.y * random.size(0.4, 1.1), p.z * random.size(0.4, 1.1)};
  if (kind == ShapeKind::hull) return ConvexHull{points};
  TriangleMesh mesh = box_mesh(1);
  mesh.vertices = points;
  return mesh;
}

/// Two objects at one place of a world, and the same without it.
struct Pair {
  PreparedShape a, b;
  Pose pose_a, pose_b;
  bool touching;  ///< placed to touch, within a millionth of a metre
};

/// Pairs of all kinds in both orders, each far from the others, in a world that has found their contacts.
class PairWorld {
 public:
  PairWorld(std::size_t each, std::uint64_t seed) : random_(seed) {
    WorldConfig config;
    config.nodes = 0;
    config.bounds_min = {-100, -100, -100};
    config.bounds_max = {spacing * static_cast<double>(each * shape_kinds * shape_kinds), 100, 100};
    world_ = std::make_unique<World>(config);
    for (std::size_t p = 0; p < shape_kinds; ++p) {
      for (std::size_t q = 0; q < shape_kinds; ++q) {
        for (std::size_t i = 0; i < each; ++i) add(static_cast<ShapeKind>(p), static_cast<ShapeKind>(q), i % 3 == 0);
      }
    }
    REQUIRE(world_->advance() == Status::ok);
    found_.assign(pairs_.size(), nullptr);
    for (const Contact& contact : world_->contacts()) {
      REQUIRE(contact.b == contact.a + 1);
      found_[contact.a / 2 - 1] = &contact;
    }
  }

  const std::vector<Pair>& pairs() const { return pairs_; }
  /// The World's contact of a pair; null if it found none.
  const Contact* contact(std::size_t pair) const { return found_[pair]; }

 private:
  static constexpr double spacing = 50;

  void add(ShapeKind p, ShapeKind q, bool touching) {
    const Vec3d origin{spacing * static_cast<double>(pairs_.size()), 0, 0};
    if (touching) {
      const float h = 0.25f * static_cast<float>(1 + random_.below(4)),
                  k = 0.25f * static_cast<float>(1 + random_.below(4));
      const double gap = random_.below(3) == 0 ? 1e-6 * random_.uniform(-1, 1) : 0;
      const double x = static_cast<double>(h) + static_cast<double>(k) + gap;
      add(straight_shape(p, h), {origin, {}}, straight_shape(q, k), {{origin.x + x, 0, 0}, {}}, true);
      return;
    }
    const Pose pose_a{origin, random_.orientation()};
    const Vec3d d = random_.direction();
    const double r = random_.uniform(0, 2.5);
    const Pose pose_b{{origin.x + d.x * r, d.y * r, d.z * r}, random_.orientation()};
    const ShapeDescription a = random_shape(p, random_), b = random_shape(q, random_);
    add(a, pose_a, b, pose_b, false);
  }

  void add(const ShapeDescription& a, const Pose& pose_a, const ShapeDescription& b, const Pose& pose_b,
           bool touching) {
    const auto number = static_cast<ObjectNumber>(2 * pairs_.size());
    const auto spawn = [&](ObjectNumber n, const ShapeDescription& shape, const Pose& pose) {
      const ShapeId registered = world_->add_shape(shape);
      REQUIRE(world_->spawn({.number = n, .shape = registered, .pose = pose}).status == Status::ok);
    };
    spawn(number + 2, a, pose_a);
    spawn(number + 3, b, pose_b);
    pairs_.push_back({PreparedShape(a), PreparedShape(b), pose_a, pose_b, touching});
  }

  Random random_;
  std::unique_ptr<World> world_;
  std::vector<Pair> pairs_;
  std::vector<const Contact*> found_;
};

bool same_bits(const ContactGeometry& found, const Contact& contact) {
  return std::memcmp(&found.normal, &contact.normal, sizeof found.normal) == 0 &&
         std::memcmp(&found.depth, &contact.depth, sizeof found.depth) == 0 &&
         std::memcmp(&found.point, &contact.point, sizeof found.point) == 0;
}

TEST_CASE("collide finds the bits that a World finds, for all pairs of kinds and from every environment") {
  const std::uint64_t seed = 1;
  CAPTURE(seed);
  const PairWorld world(60, seed);
  std::size_t contacts = 0, touching = 0;
  for (std::size_t i = 0; i < world.pairs().size(); ++i) {
    CAPTURE(i);
    const Pair& pair = world.pairs()[i];
    CAPTURE(std::string(name_of(pair.a.kind())));
    CAPTURE(std::string(name_of(pair.b.kind())));
    const Contact* const contact = world.contact(i);
    for (const Caller caller : callers) {
      CAPTURE(std::string(name_of(caller)));
      const CollideResult found = call_from(caller, [&] { return collide(pair.a, pair.pose_a, pair.b, pair.pose_b); });
      REQUIRE(found.status == Status::ok);
      REQUIRE(found.contact.has_value() == (contact != nullptr));
      if (contact != nullptr) REQUIRE(same_bits(*found.contact, *contact));
    }
    contacts += contact != nullptr;
    touching += contact != nullptr && contact->depth < 1e-6f;
  }
  CHECK(contacts > 700);
  CHECK(contacts < 1800);
  CHECK(touching > 200);
}

TEST_CASE("distance is the same in every environment, is symmetric, and is 0 where a World finds a deep contact") {
  const std::uint64_t seed = 2;
  CAPTURE(seed);
  const PairWorld world(20, seed);
  for (std::size_t i = 0; i < world.pairs().size(); ++i) {
    CAPTURE(i);
    const Pair& pair = world.pairs()[i];
    CAPTURE(std::string(name_of(pair.a.kind())));
    CAPTURE(std::string(name_of(pair.b.kind())));
    const DistanceResult found = distance(pair.a, pair.pose_a, pair.b, pair.pose_b);
    REQUIRE(found.status == Status::ok);
    for (const Caller caller : callers) {
      const DistanceResult again =
          call_from(caller, [&] { return distance(pair.a, pair.pose_a, pair.b, pair.pose_b); });
      REQUIRE(std::memcmp(&again.distance, &found.distance, sizeof found - offsetof(DistanceResult, distance)) == 0);
    }
    const DistanceResult swapped = distance(pair.b, pair.pose_b, pair.a, pair.pose_a);
    const bool function = pair.a.kind() == ShapeKind::support || pair.b.kind() == ShapeKind::support;
    CHECK(std::abs(swapped.distance - found.distance) <= (function ? 1e-5 : 1e-11));
    const Contact* const contact = world.contact(i);
    if (contact != nullptr && contact->depth > 1e-4f) CHECK(found.distance == 0);
    if (pair.touching) CHECK(found.distance < 1e-5);
    if (contact == nullptr && !pair.touching) CHECK(found.distance > 0);
  }
}

TEST_CASE("distance returns the closest points and the normal between them") {
  const PreparedShape ball(Sphere{1}), box(Box{{1, 2, 3}});
  const DistanceResult found = distance(ball, {{10, 0, 0}, {}}, box, {{10, 7, 0}, {}});
  CHECK(found.status == Status::ok);
  CHECK(found.distance == doctest::Approx(4));
  CHECK(found.normal.y == doctest::Approx(1));
  CHECK(found.point_a.y == doctest::Approx(1));
  CHECK(found.point_b.y == doctest::Approx(5));
  CHECK(found.point_b.x == doctest::Approx(10));
  const DistanceResult inside = distance(ball, {{10, 0, 0}, {}}, box, {{10, 2, 0}, {}});
  CHECK(inside.distance == 0);
  CHECK(inside.point_a == inside.point_b);
  CHECK(inside.normal == Vec3d{});
}

TEST_CASE("invalid poses are refused with the status that World::place returns") {
  constexpr double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const auto nan_float = static_cast<float>(nan);
  const Pose poses[] = {{{nan, 0, 0}, {}},
                        {{0, infinity, 0}, {}},
                        {{0, 0, -1.1 * farthest_coordinate}, {}},
                        {{}, {nan_float, 0, 0, 1}},
                        {{}, {0, 0, 0, 0}},
                        {{}, {0, 0, 0, 1.01f}},
                        {{}, {0, 0, 0, 0.9995f}},
                        {{farthest_coordinate, 0, 0}, {}}};
  WorldConfig config;
  config.nodes = 0;
  World world(config);
  const ObjectId object = world.spawn({.shape = world.add_shape(Sphere{1})}).id;
  const PreparedShape ball(Sphere{1}), mesh(box_mesh(1));
  for (const Pose& pose : poses) {
    const Status expected = world.place(object, pose);
    for (const PreparedShape* other : {&ball, &mesh}) {
      CHECK(collide(ball, pose, *other, {}).status == expected);
      CHECK(collide(*other, {}, ball, pose).status == expected);
      CHECK(distance(ball, pose, *other, {}).status == expected);
      CHECK(distance(*other, {}, ball, pose).status == expected);
      if (expected != Status::ok) CHECK(!collide(ball, pose, *other, {}).contact.has_value());
    }
  }
}

TEST_CASE("an orientation that is not quite of unit length is normalised, as in a World") {
  const PreparedShape box(Box{{1, 1, 1}});
  const Quat turned{0, 0, 0.3826834f, 0.9238795f};
  const Quat longer{0, 0, 0.3826834f * 1.0008f, 0.9238795f * 1.0008f};
  const Pose there{{2.3, 0, 0}, turned}, longer_there{{2.3, 0, 0}, longer};
  const CollideResult found = collide(box, {}, box, there), again = collide(box, {}, box, longer_there);
  REQUIRE(found.contact.has_value());
  REQUIRE(again.contact.has_value());
  CHECK(again.contact->depth == doctest::Approx(found.contact->depth));
}

class Failing final : public SupportFunction {
 public:
  explicit Failing(int intact_calls) : intact_calls_(intact_calls) {}
  Vec3f support(Vec3f d) const override {
    if (calls_++ >= intact_calls_) throw std::runtime_error("no more");
    return Ellipsoid({1, 1, 1}).support(d);
  }

 private:
  int intact_calls_;
  mutable int calls_ = 0;
};

TEST_CASE("a support function that fails is reported, and at preparation it is an error") {
  const PreparedShape ball(Sphere{1}), mesh(box_mesh(1));
  CHECK_THROWS_AS(PreparedShape(SupportShape{std::make_shared<Failing>(0)}), Error);
  for (const PreparedShape* other : {&ball, &mesh}) {
    const PreparedShape failing(SupportShape{std::make_shared<Failing>(6)});
    CHECK(collide(failing, {}, *other, {{1.5, 0, 0}, {}}).status == Status::support_failed);
    CHECK(distance(failing, {}, *other, {{5, 0, 0}, {}}).status == Status::support_failed);
    CHECK(distance(*other, {}, failing, {{5, 0, 0}, {}}).status == Status::support_failed);
  }
}

TEST_CASE("an invalid shape is refused with a reason") {
  CHECK_THROWS_WITH_AS(PreparedShape(Sphere{0}), "sphere radius is 0 m; expected 0.0005 to 1000000", Error);
  CHECK_THROWS_AS(PreparedShape(ConvexHull{{{0, 0, 0}}}), Error);
}

TEST_CASE("copies of a prepared shape can be used by several threads at the same time") {
  const std::uint64_t seed = 3;
  CAPTURE(seed);
  const PairWorld world(2, seed);
  std::vector<std::thread> threads;
  std::vector<int> wrong(3, 0);
  for (int& own_wrong : wrong) {
    threads.emplace_back([&own_wrong, &world] {
      for (std::size_t i = 0; i < world.pairs().size(); ++i) {
        const Pair pair = world.pairs()[i];
        const CollideResult found = collide(pair.a, pair.pose_a, pair.b, pair.pose_b);
        const bool expected = world.contact(i) != nullptr;
        own_wrong +=
            found.contact.has_value() != expected || (expected && !same_bits(*found.contact, *world.contact(i)));
        own_wrong += distance(pair.a, pair.pose_a, pair.b, pair.pose_b).status != Status::ok;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong == std::vector<int>(3, 0));
}

}  // namespace
}  // namespace ringfence::test
