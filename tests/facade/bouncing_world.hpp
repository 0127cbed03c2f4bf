#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "base/caller_environment.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {

/// A small world with many collisions: objects fly straight, turn at walls, and are pushed out of and reflected by
/// their contacts. It uses everything a frame may depend on, so that any difference between deployments becomes
/// visible.
class BouncingModel : public MotionModel {
 public:
  struct State {
    double velocity[3];
    std::uint64_t hits;
  };
  explicit BouncingModel(double side) : side_(side) {}
  std::size_t state_bytes() const noexcept override { return sizeof(State); }

  void start(const ObjectSpec& spec, std::byte* state) const override {
    State s{};
    std::uint64_t h = spec.number * 0x9e3779b97f4a7c15u + 1;
    for (double& v : s.velocity) {
      h ^= h >> 29;
      h *= 0xbf58476d1ce4e5b9u;
      h ^= h >> 32;
      v = static_cast<double>(h % 2001) / 1000.0 - 1.0;
    }
    if (spec.category == Category::non_active) {
      s = {};
    }
    std::memcpy(state, &s, sizeof s);
  }

  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const MotionInput& in = inputs[i];
      if (!in.enabled) {
        continue;
      }
      State s;
      std::memcpy(&s, in.state, sizeof s);
      double p[3] = {in.pose.position.x, in.pose.position.y, in.pose.position.z};
      for (std::size_t c = 0; c < in.contacts.size(); ++c) {
        const Contact& contact = in.contacts[c];
        const double sign = contact.a == in.number ? -1.0 : 1.0;
        const double n[3] = {sign * static_cast<double>(contact.normal.x), sign * static_cast<double>(contact.normal.y),
                             sign * static_cast<double>(contact.normal.z)};
        const double along = s.velocity[0] * n[0] + s.velocity[1] * n[1] + s.velocity[2] * n[2];
        for (int k = 0; k < 3; ++k) {
          s.velocity[k] += along < 0 ? -1.5 * along * n[k] : 0.0;
          p[k] += 0.25 * static_cast<double>(contact.depth) * n[k];
        }
        ++s.hits;
      }
      // The first three bytes of an input are a push in centimetres.
      for (std::size_t k = 0; k < 3 && k < in.input.size(); ++k) {
        p[k] += 0.01 * static_cast<std::int8_t>(in.input[k]);
      }
      for (int k = 0; k < 3; ++k) {
        p[k] += 0.25 * s.velocity[k];
        // Slightly beyond the bounds: the outer regions extend to infinity.
        if ((p[k] < -1.0 && s.velocity[k] < 0) || (p[k] > side_ + 1.0 && s.velocity[k] > 0)) {
          s.velocity[k] = -s.velocity[k];
        }
      }
      outputs[i].pose.position = {p[0], p[1], p[2]};
      std::memcpy(outputs[i].state, &s, sizeof s);
    }
  }

 private:
  double side_;
};

/// The same, but it throws for some objects in some frames.
class ThrowingModel : public BouncingModel {
 public:
  using BouncingModel::BouncingModel;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (const MotionInput& in : inputs) {
      if (in.number % 10 == frame % 4) throw Error("no move for " + std::to_string(in.number));
    }
    BouncingModel::move(frame, inputs, outputs);
  }
};

/// Throws Error, which fails a test, unless a call was accepted.
inline void require_ok(Status status) {
  if (status != Status::ok) {
    throw Error(name_of(status));
  }
}

/// Spheres, boxes and capsules at pseudo-random positions in a cube of `side`: one avatar per user, the others
/// alternately active and non-active, every seventeenth static. Makes the calls as `caller`; the
/// values do not depend on it.
inline void populate(World& world, std::size_t objects, std::size_t users, double side, Caller caller = Caller::usual) {
  const auto add = [&](const ShapeDescription& shape) {
    return call_from(caller, [&] { return world.add_shape(shape); });
  };
  const std::vector<ShapeId> shapes = {add(Sphere{0.7f}), add(Box{{0.6f, 0.8f, 0.5f}}), add(Capsule{0.4f, 0.6f})};
  for (std::size_t user = 0; user < users; ++user) {
    require_ok(call_from(caller, [&] { return world.connect(); }).status);
  }
  std::uint64_t h = 12345;
  const auto uniform = [&] {
    h = h * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(h >> 11) / 9007199254740992.0;
  };
  for (std::size_t i = 0; i < objects; ++i) {
    ObjectSpec spec;
    spec.shape = shapes[i % shapes.size()];
    spec.user_data = i;
    spec.group = i % 6 == 5 ? static_cast<std::uint32_t>(1 + i % 4) : 0;
    spec.pose.position = {uniform() * side, uniform() * side, uniform() * side};
    if (i < users) {
      spec.category = Category::avatar;
      spec.user = UserId(static_cast<std::uint32_t>(i));
    } else if (i % 17 == 0) {
      spec.category = Category::fixed;
    } else {
      spec.category = i % 2 == 0 ? Category::active : Category::non_active;
    }
    require_ok(call_from(caller, [&] { return world.spawn(spec); }).status);
  }
}

}  // namespace ringfence::test
