#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <span>
#include <vector>

#include "base/caller_environment.hpp"
#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {

/// Random requests to a world: users connect, disconnect and steer; objects are spawned, destroyed, placed, enabled,
/// disabled, moved and changed. Every world with the same seed gets the same calls in the same order, so all must
/// return and end the same. The calls are made as `caller`.
class Script {
 public:
  struct Live {
    ObjectId id;
    Category category;
    UserId user;
  };

  Script(World& world, unsigned seed, double side, Caller caller = Caller::usual)
      : world_(world), random_(seed), side_(side), caller_(caller) {
    const auto add = [&](const ShapeDescription& shape) {
      return call_from(caller_, [&] { return world.add_shape(shape); });
    };
    shapes_ = {add(Sphere{0.7f}), add(Box{{0.6f, 0.8f, 0.5f}}), add(Capsule{0.4f, 0.6f}),
               add(ConvexHull{{{1, 0, 0}, {-1, 0.2f, 0}, {0, 1, 0.3f}, {0.1f, -1, 0}, {0, 0, 1}, {0, 0, -1}}})};
    // One object in thirteen is an ellipsoid: libccd takes a hundred times as long as the kernels.
    for (int i = 0; i < 8; ++i) shapes_.push_back(shapes_[static_cast<std::size_t>(i % 4)]);
    shapes_.push_back(add(SupportShape{std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})}));
    for (int i = 0; i < 4; ++i) connect();
    for (int i = 0; i < 120; ++i) spawn();
  }

  /// Makes the requests for the next frame. All are valid and must succeed.
  void make_requests() {
    if (random_() % 6 == 0 && users_.size() < 8) connect();
    if (random_() % 8 == 0 && !users_.empty()) disconnect(random_() % users_.size());
    if (random_() % 25 == 0) {
      while (!users_.empty()) disconnect(0);
    }
    for (std::uint64_t n = random_() % 5; n > 0; --n) spawn();
    for (std::uint64_t n = random_() % 5; n > 0 && live_.size() > 80; --n) {
      const std::size_t at = random_() % live_.size();
      const Live object = live_[at];
      const bool by_user = object.category == Category::avatar && random_() % 2 == 0;
      REQUIRE(call_from(caller_, [&] {
                return by_user ? world_.destroy(object.user, object.id) : world_.destroy(object.id);
              }) == Status::ok);
      live_.erase(live_.begin() + static_cast<std::ptrdiff_t>(at));
    }
    for (std::uint64_t n = random_() % 8; n > 0; --n) {
      const Live& object = live_[random_() % live_.size()];
      if (object.category == Category::fixed) continue;
      if (object.category == Category::avatar) steer(object);
      switch (random_() % 4) {
        case 0: {
          const bool enabled = random_() % 3 == 0;
          REQUIRE(call_from(caller_, [&] { return world_.set_enabled(object.id, enabled); }) == Status::ok);
          break;
        }
        case 1:
          if (object.category == Category::avatar) {
            const Pose there = pose();
            REQUIRE(call_from(caller_, [&] { return world_.move(object.user, object.id, there); }) == Status::ok);
            break;
          }
          [[fallthrough]];
        default:
          const Pose there = pose();
          REQUIRE(call_from(caller_, [&] { return world_.place(object.id, there); }) == Status::ok);
      }
    }
    for (std::uint64_t n = random_() % 8; n > 0; --n) change(live_[random_() % live_.size()]);
  }

  /// A change of group, layer, shape or model state of any object.
  void change(const Live& object) {
    const std::uint64_t draw = random_();
    const Status status = call_from(caller_, [&] {
      switch (draw % 4) {
        case 0:
          return world_.set_group(object.id, static_cast<std::uint32_t>(draw / 4 % 4));
        case 1:
          return world_.set_layer(object.id, static_cast<std::uint8_t>(draw / 4 % layers_));
        case 2:
          return world_.set_shape(object.id, shapes_[draw / 4 % shapes_.size()]);
        default: {
          const std::span<const std::byte> state = world_.state(object.id);
          std::vector<std::byte> turned(state.begin(), state.end());
          if (turned.size() < 24 || object.category == Category::fixed) return Status::ok;
          std::rotate(turned.begin(), turned.begin() + 8, turned.begin() + 24);  // the velocity of BouncingModel
          return world_.set_state(object.id, turned);
        }
      }
    });
    REQUIRE(status == Status::ok);
  }

  std::size_t live() const { return live_.size(); }
  const std::vector<UserId>& users() const { return users_; }

 private:
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_() >> 11) * 0x1p-53);
  }
  Pose pose() {
    const double margin = random_() % 10 == 0 ? side_ : 1;  // now and then far outside the bounds
    Pose pose;
    pose.position = {uniform(-margin, side_ + margin), uniform(-margin, side_ + margin),
                     uniform(-margin, side_ + margin)};
    const double half = uniform(0, 1);
    pose.orientation = {static_cast<float>(half), 0, 0, static_cast<float>(std::sqrt(1 - half * half))};
    return pose;
  }
  void steer(const Live& avatar) {
    std::byte bytes[max_input_bytes];
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random_());
    const std::span input(bytes, random_() % (max_input_bytes + 1));
    REQUIRE(call_from(caller_, [&] { return world_.input(avatar.user, avatar.id, input); }) == Status::ok);
  }
  void connect() {
    const Connected connected = call_from(caller_, [&] { return world_.connect(); });
    REQUIRE(connected.status == Status::ok);
    users_.insert(std::lower_bound(users_.begin(), users_.end(), connected.user), connected.user);
  }
  void disconnect(std::size_t at) {
    const UserId user = users_[at];
    REQUIRE(call_from(caller_, [&] { return world_.disconnect(user); }) == Status::ok);
    users_.erase(users_.begin() + static_cast<std::ptrdiff_t>(at));
    std::erase_if(live_, [&](const Live& object) { return object.user == user; });
  }
  void spawn() {
    ObjectSpec spec;
    spec.shape = shapes_[random_() % shapes_.size()];
    spec.enabled = random_() % 12 != 0;
    spec.user_data = random_();
    spec.group = spec.user_data % 4 == 0 ? static_cast<std::uint32_t>(1 + spec.user_data / 4 % 5) : 0;
    spec.pose = pose();
    const std::uint64_t kind = random_() % 10;
    spec.category = kind == 0 ? Category::fixed : kind < 6 ? Category::active : Category::non_active;
    if (kind > 7 && !users_.empty()) {
      spec.category = Category::avatar;
      spec.user = users_[random_() % users_.size()];
    }
    const Spawned spawned = call_from(caller_, [&] { return world_.spawn(spec); });
    REQUIRE(spawned.status == Status::ok);
    live_.push_back({spawned.id, spec.category, spec.user});
    if (random_() % 40 == 0) {
      REQUIRE(call_from(caller_, [&] { return world_.destroy(spawned.id); }) == Status::ok);  // it was never in a frame
      live_.pop_back();
    }
  }

  World& world_;
  std::mt19937_64 random_;
  double side_;
  Caller caller_;
  std::size_t layers_ = std::max<std::size_t>(1, world_.config().layers.names.size());
  std::vector<ShapeId> shapes_;
  std::vector<UserId> users_;
  std::vector<Live> live_;
};

/// A hash of all object states and of all contacts, ended ones too.
inline std::uint64_t fingerprint(const World& world) {
  std::uint64_t h = 0;
  const auto add = [&](const void* bytes, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
      h = (h ^ static_cast<const unsigned char*>(bytes)[i]) * 0x100000001b3u + 0x9e37u;
    }
  };
  for (const ObjectView& view : world.objects()) {
    add(&view.id, sizeof view.id);
    add(&view.spec.pose, sizeof view.spec.pose);
    add(&view.spec.enabled, sizeof view.spec.enabled);
    const std::uint32_t kind[] = {view.spec.shape.number(), view.spec.layer, view.spec.group};
    add(kind, sizeof kind);
    const std::span<const std::byte> state = world.state(view.id);
    add(state.data(), state.size());
  }
  for (const Contact& contact : world.ended()) add(&contact, sizeof contact);
  for (const Contact& contact : world.contacts()) add(&contact, sizeof contact);
  return h;
}

}  // namespace ringfence::test
