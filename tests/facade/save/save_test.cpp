#include "ringfence/save.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/queries/sensing_model.hpp"
#include "facade/script.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 9;

/// The same world in one of many deployments. `deepest`: WorldConfig::deepest_contacts.
WorldConfig config_of(unsigned variant, std::uint32_t deepest = 0) {
  constexpr Deployment deployments[] = {Deployment::user_collision, Deployment::user, Deployment::user_server};
  WorldConfig config;
  config.nodes = variant % 4;
  config.deployment = deployments[variant / 4 % 3];
  config.placement = variant / 12 % 2 == 0 ? Placement::region : Placement::server;
  config.interest = 4;
  config.layers = {{"a", "b", "c"}, {{0, 0}, {0, 1}, {1, 1}, {2, 0}}};
  config.quotas.colliding_avatars = 4;
  config.deepest_contacts = deepest;
  config.sense = 4;
  config.motion = std::make_shared<SensingModel>(side, config.sense, false);
  config.support_functions = {nullptr, std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
  return config;
}
constexpr unsigned variants = 24;

std::vector<std::byte> save(World& world, std::span<const std::byte> own = {}) {
  MemorySink sink;
  REQUIRE(world.save(sink, own) == Status::ok);
  return sink.bytes();
}

World restore(WorldConfig config, std::span<const std::byte> bytes) {
  MemorySource source(bytes);
  return World(std::move(config), source);
}

std::string error_of(const WorldConfig& config, std::span<const std::byte> bytes) {
  try {
    (void)restore(config, bytes);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("a world that is saved and restored in any deployment continues as the one that was not interrupted") {
  constexpr int frames = 60;
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  World reference(config_of(0)), world(config_of(static_cast<unsigned>(random() % variants)));
  Script reference_script(reference, seed, side), script(world, seed, side);
  int restored = 0;
  for (int frame = 0; frame < frames; ++frame) {
    CAPTURE(frame);
    reference_script.make_requests();
    script.make_requests();
    if (random() % 3 == 0) {  // with requests pending, and before the first frame too
      WorldConfig config = config_of(static_cast<unsigned>(random() % variants));
      config.layers = random() % 2 == 0 ? config.layers : LayerMatrix{};
      const std::vector<std::byte> bytes = save(world);
      world = restore(std::move(config), bytes);
      CHECK(save(world) == bytes);
      ++restored;
    }
    REQUIRE(reference.advance() == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(fingerprint(world) == fingerprint(reference));
    REQUIRE(world.report().tested + world.report().carried == world.report().candidates);
  }
  CHECK(restored > 0);
  CHECK(world.frames() == frames);
}

TEST_CASE("a save has the same bytes in every deployment") {
  std::vector<std::byte> expected;
  for (unsigned variant = 0; variant < variants; ++variant) {
    CAPTURE(variant);
    World world(config_of(variant));
    Script script(world, 7, side);
    for (int frame = 0; frame < 12; ++frame) {
      script.make_requests();
      REQUIRE(world.advance() == Status::ok);
    }
    script.make_requests();
    const std::vector<std::byte> bytes = save(world);
    expected = expected.empty() ? bytes : expected;
    CHECK(bytes == expected);
  }
}

TEST_CASE(
    "with a limit of contacts a restored world continues with the list of the saved one, and phases follow from it") {
  World reference(config_of(0, 1)), world(config_of(3, 1));
  Script reference_script(reference, 31, side), script(world, 31, side);
  std::uint64_t unlisted = 0;
  for (unsigned frame = 0; frame < variants; ++frame) {
    CAPTURE(frame);
    reference_script.make_requests();
    script.make_requests();
    const std::vector<std::byte> bytes = save(world);
    CHECK(bytes == save(reference));
    world = restore(config_of(frame, 1), bytes);
    REQUIRE(reference.advance() == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(fingerprint(world) == fingerprint(reference));
    REQUIRE(world.report().unlisted == reference.report().unlisted);
    unlisted += world.report().unlisted;
  }
  CHECK(unlisted > 10);
}

TEST_CASE("before its first frame a restored world shows the last frame of the saved one") {
  World world(config_of(2));
  Script script(world, 5, side);
  for (int frame = 0; frame < 20; ++frame) {
    script.make_requests();
    REQUIRE(world.advance() == Status::ok);
  }
  World other = restore(config_of(7), save(world));
  CHECK(other.frames() == 20);
  REQUIRE(other.contacts().size() == world.contacts().size());
  REQUIRE(world.contacts().size() > 3);
  for (std::size_t i = 0; i < world.contacts().size(); ++i) {
    CHECK(std::memcmp(&other.contacts()[i], &world.contacts()[i], sizeof(Contact)) == 0);
  }
  const auto views = world.objects(), others = other.objects();
  REQUIRE(others.size() == views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const ObjectId id = views[i].id;
    CHECK(others[i].id == id);
    CHECK(others[i].spec.pose == views[i].spec.pose);
    CHECK(other.find(id.number()) == world.find(id.number()));
    const auto state = world.state(id), same = other.state(id);
    CHECK(std::vector(state.begin(), state.end()) == std::vector(same.begin(), same.end()));
    CHECK(other.collisions_of(id).size() == world.collisions_of(id).size());
  }
  CHECK(other.ended().empty());
  CHECK(other.nodes() == 3);
  CHECK(other.snapshot().objects() == world.snapshot().objects());
  CHECK(other.snapshot().frame() == 19);
}

TEST_CASE("ids continue: stale ones stay stale, and new ones are those of the saved world") {
  WorldConfig config;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1}), removed = world.add_shape(Sphere{2});
  REQUIRE(world.remove_shape(removed) == Status::ok);
  const ObjectId first = world.spawn({.shape = ball}).id, second = world.spawn({.shape = ball}).id;
  const UserId user = world.connect(UserId(3)).user;
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(world.destroy(first) == Status::ok);
  REQUIRE(world.disconnect(user) == Status::ok);
  World other = restore(config, save(world));
  for (World* const one : {&world, &other}) {
    CHECK(one->destroy(first) == Status::stale_object);
    CHECK(one->place(second, {}) == Status::ok);
    CHECK(one->connect(UserId(3)).status == Status::number_in_use);
    CHECK(one->spawn({.number = first.number(), .shape = ball}).status == Status::number_in_use);
    CHECK(one->spawn({.shape = removed}).status == Status::unknown_shape);
    CHECK(!one->has_shape(removed));
    CHECK(one->shape_count() == 2);
    CHECK(one->remove_shape(ball) == Status::shape_in_use);
  }
  CHECK(world.spawn({.shape = ball}).id == other.spawn({.shape = ball}).id);
  CHECK(world.connect().user == other.connect().user);
  CHECK(world.add_shape(Sphere{3}) == other.add_shape(Sphere{3}));
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(other.advance() == Status::ok);
  CHECK(fingerprint(world) == fingerprint(other));
  CHECK(world.connect(UserId(3)).status == Status::ok);
  CHECK(other.connect(UserId(3)).status == Status::ok);
}

TEST_CASE("what a user has used of its quotas is restored") {
  WorldConfig config;
  config.quotas.spawns = 3;
  config.quotas.moves = 5;
  config.quotas.window = 10;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  const UserId user = world.connect().user;
  const ObjectSpec avatar{.shape = ball, .category = Category::avatar, .user = user};
  const ObjectId id = world.spawn(avatar).id;
  REQUIRE(world.spawn(avatar).status == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  for (int i = 0; i < 4; ++i) REQUIRE(world.move(user, id, {}) == Status::ok);
  World other = restore(config, save(world));
  for (World* const one : {&world, &other}) {
    CHECK(one->spawn(avatar).status == Status::ok);
    CHECK(one->spawn(avatar).status == Status::over_quota);
    CHECK(one->move(user, id, {}) == Status::ok);
    CHECK(one->move(user, id, {}) == Status::over_quota);
    CHECK(one->refused(user) == 2);
    for (int frame = 1; frame < 10; ++frame) REQUIRE(one->advance() == Status::ok);
    CHECK(one->spawn(avatar).status == Status::ok);  // a new window
  }
}

TEST_CASE("automatic bounds of a restored world are around its objects, and explicit ones are kept") {
  WorldConfig config;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (int i = 0; i < 8; ++i) {
    REQUIRE(world.spawn({.shape = ball, .pose = {{5000.0 + 10 * i, 0, 0}, {}}}).status == Status::ok);
  }
  REQUIRE(world.advance() == Status::ok);
  const World other = restore(config, save(world));
  CHECK(other.config().bounds_min == world.config().bounds_min);
  CHECK(other.config().bounds_max == world.config().bounds_max);
  config.bounds_max = {100, 100, 100};
  CHECK(restore(config, save(world)).config().bounds_max == Vec3d{100, 100, 100});
}

TEST_CASE("the caller's bytes come back") {
  WorldConfig config;
  World world(config);
  const std::byte own[] = {std::byte{1}, std::byte{0}, std::byte{255}};
  const World other = restore(config, save(world, own));
  CHECK(std::vector(other.saved_bytes().begin(), other.saved_bytes().end()) == std::vector(own, own + 3));
  CHECK(world.saved_bytes().empty());
}

TEST_CASE("a save is refused while a frame is running, if the sink fails, and if a support function has no name") {
  class FullSink final : public Sink {
   public:
    bool write(std::span<const std::byte> bytes) override { return (written_ += bytes.size()) < 100; }

   private:
    std::size_t written_ = 0;
  };
  class Nameless final : public SupportFunction {
    Vec3f support(Vec3f d) const override {
      return {d.x > 0 ? 1.0f : -1.0f, d.y > 0 ? 1.0f : -1.0f, d.z > 0 ? 1.0f : -1.0f};
    }
  };
  World world{WorldConfig{}};
  MemorySink sink;
  FullSink full;
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(world.save(sink) == Status::out_of_order);
  REQUIRE(world.finish_frame() == Status::ok);
  CHECK(world.save(full) == Status::not_written);
  CHECK(world.save(sink) == Status::ok);
  const ShapeId shape = world.add_shape(SupportShape{std::make_shared<Nameless>()});
  CHECK(world.save(sink) == Status::bad_shape);
  REQUIRE(world.remove_shape(shape) == Status::ok);
  CHECK(world.save(sink) == Status::ok);
}

TEST_CASE("a configuration that does not fit the save is refused with what to do") {
  World world(config_of(1));
  const Script script(world, 3, side);
  REQUIRE(world.advance() == Status::ok);
  const std::vector<std::byte> bytes = save(world);
  WorldConfig config = config_of(1);
  CHECK(error_of(config, bytes).empty());
  config.motion = nullptr;
  CHECK(error_of(config, bytes).find("restore it with the same model") != std::string::npos);
  config = config_of(1);
  config.layers.collide.pop_back();
  CHECK(error_of(config, bytes).find("layers") != std::string::npos);
  config = config_of(1);
  config.support_functions = {std::make_shared<Ellipsoid>(Vec3f{0.6f, 0.7f, 0.9f})};
  CHECK(error_of(config, bytes).find("'ellipsoid'") != std::string::npos);
  config = config_of(1);
  config.limits.objects = config.capacities.objects = 50;
  CHECK(error_of(config, bytes).find("limits.objects") != std::string::npos);
  config = config_of(1);
  config.limits.users = config.capacities.users = 2;
  CHECK(error_of(config, bytes).find("limits.users") != std::string::npos);
}

TEST_CASE("every save that ends early, has a changed bit or bytes too many is refused") {
  WorldConfig config;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (int i = 0; i < 3; ++i) REQUIRE(world.spawn({.shape = ball}).status == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  std::vector<std::byte> bytes = save(world);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    CHECK(!error_of(config, std::span(bytes).first(size)).empty());
  }
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1u << bit % 8)};
    bytes[bit / 8] ^= mask;
    CHECK(!error_of(config, bytes).empty());
    bytes[bit / 8] ^= mask;
  }
  bytes.push_back({});
  CHECK(error_of(config, bytes).find("checksum") != std::string::npos);
}

}  // namespace
}  // namespace ringfence::test
