// Records that do not fit together, with a correct checksum: as an attacker writes them.
#include "facade/save/save_check.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/save/save_format.hpp"
#include "facade/script.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 9;

WorldConfig config_of(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.layers = {{"a", "b"}, {{0, 0}, {0, 1}}};
  config.motion = std::make_shared<BouncingModel>(side);
  config.support_functions = {std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
  return config;
}

facade::SavedWorld saved_world(unsigned seed) {
  const WorldConfig config = config_of(0);
  World world(config);
  Script script(world, seed, side);
  for (int frame = 0; frame < 6; ++frame) {
    script.make_requests();
    REQUIRE(world.advance() == Status::ok);
  }
  for (int i = 0; i < 10; ++i) script.make_requests();
  MemorySink sink;
  REQUIRE(world.save(sink) == Status::ok);
  MemorySource source(sink.bytes());
  return facade::read_save(source, config.support_functions);
}

/// The message with which a World refuses the records; empty if it runs with them.
std::string error_of(const facade::SavedWorld& saved, std::uint32_t nodes) {
  MemorySink sink;
  REQUIRE(facade::write_save(saved, sink));
  MemorySource source(sink.bytes());
  try {
    World world(config_of(nodes), source);
    for (int frame = 0; frame < 2; ++frame) REQUIRE(world.advance() == Status::ok);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("records that do not fit together are refused") {
  const facade::SavedWorld good = saved_world(11);
  REQUIRE(good.objects.size() > 50);
  REQUIRE(good.contacts.size() > 10);
  REQUIRE(good.users.size() > 1);
  REQUIRE(good.requests.size() > 10);
  REQUIRE(!good.inputs.empty());
  CHECK(error_of(good, 1).empty());
  const auto refused = [&](const std::function<void(facade::SavedWorld&)>& change) {
    MemorySink sink;
    REQUIRE(facade::write_save(good, sink));
    MemorySource source(sink.bytes());
    facade::SavedWorld bad = facade::read_save(source, config_of(0).support_functions);
    change(bad);
    return !error_of(bad, 1).empty();
  };
  CHECK(refused([](auto& saved) { saved.frames = ~std::uint64_t{0}; }));
  CHECK(refused([](auto& saved) { saved.frames = 0; }));
  CHECK(refused([](auto& saved) { saved.objects[3].number = saved.objects[2].number; }));
  CHECK(refused([](auto& saved) { saved.objects[0].number = 0; }));
  CHECK(refused([](auto& saved) { saved.objects[0].category = 4; }));
  CHECK(refused([](auto& saved) { saved.objects[0].shape = 1000; }));
  CHECK(refused([](auto& saved) { saved.objects[0].layer = 2; }));
  CHECK(refused([](auto& saved) { saved.objects[0].pose.position.x = 1e300; }));
  CHECK(refused([](auto& saved) { saved.objects[0].pose.orientation.w += 1e-4f; }));
  CHECK(refused([](auto& saved) { saved.objects[0].user = saved.objects[0].user == no_user.number() ? 0 : 77; }));
  CHECK(refused([](auto& saved) { saved.objects.pop_back(); }));
  CHECK(refused([](auto& saved) { saved.contacts[1] = saved.contacts[0]; }));
  CHECK(refused([](auto& saved) { std::swap(saved.contacts[0].a, saved.contacts[0].b); }));
  CHECK(refused([](auto& saved) { saved.contacts[0].b = 4'000'000'000u; }));
  CHECK(refused([](auto& saved) { saved.contacts[0].phase = 2; }));
  CHECK(refused([](auto& saved) { saved.users[1] = saved.users[0]; }));
  CHECK(refused([](auto& saved) { saved.requests[0].kind = 200; }));
  CHECK(refused([](auto& saved) {
    for (auto& request : saved.requests) request.object ^= std::uint64_t{1} << 40;
  }));
  CHECK(refused([](auto& saved) { saved.requests.push_back(saved.requests.front()), saved.requests.back().kind = 0; }));
  CHECK(refused([](auto& saved) { saved.inputs[0].size = 33; }));
  CHECK(refused([](auto& saved) { saved.inputs[0].user = 4000; }));
  CHECK(refused([](auto& saved) { saved.shapes[0] = nullptr; }));
  CHECK(refused([](auto& saved) { saved.layers.collide.emplace_back(0, 255); }));
  CHECK(refused([](auto& saved) { saved.layers.collide.emplace_back(2, 0); }));
  CHECK(refused([](auto& saved) { saved.layers.names.resize(33); }));
}

TEST_CASE("a world either refuses changed records or runs with them") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const auto change_bytes = [&](auto& records) {
    if (records.empty()) return;
    auto bytes = std::as_writable_bytes(std::span(records));
    for (std::uint64_t n = 1 + random() % 3; n > 0; --n) {
      const std::uint64_t draw = random();
      bytes[random() % bytes.size()] = static_cast<std::byte>(draw % 3 == 0 ? 0 : draw % 3 == 1 ? 255 : draw >> 8);
    }
  };
  const facade::SavedWorld good = saved_world(seed);
  MemorySink sink;
  REQUIRE(facade::write_save(good, sink));
  int refused = 0, ran = 0;
  for (int i = 0; i < 400; ++i) {
    MemorySource source(sink.bytes());
    facade::SavedWorld bad = facade::read_save(source, config_of(0).support_functions);
    switch (random() % 6) {
      case 0:
        change_bytes(bad.objects);
        break;
      case 1:
        change_bytes(bad.contacts);
        break;
      case 2:
        change_bytes(bad.users);
        break;
      case 3:
        change_bytes(bad.requests);
        break;
      case 4:
        change_bytes(bad.moves);
        break;
      default:
        change_bytes(bad.inputs);
        break;
    }
    ++(error_of(bad, i % 2 == 0 ? 0 : 2).empty() ? ran : refused);
  }
  CHECK(refused > 0);
  CHECK(ran > 0);
}

}  // namespace
}  // namespace ringfence::test
