#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "ringfence/motion_model.hpp"

namespace ringfence::test {

/// A world of balls of radius 1 m that a motion model moves. Each frame computes S(k) from S(k-1) and C(k-1), then
/// C(k). Finds contacts by brute force among the balls of neighbouring grid cells. Balls with equal centres have no
/// contact. Shares no code with the engine except the model under test. Threads: one at a time.
class BallWorld {
 public:
  /// `model` outlives the world.
  explicit BallWorld(const MotionModel& model) : model_(model) {}

  void add(ObjectNumber number, Category category, const Vec3d& position) {
    ObjectSpec spec;
    spec.number = number;
    spec.category = category;
    spec.pose.position = position;
    std::vector<std::uint64_t> state((model_.state_bytes() + 7) / 8);
    model_.start(spec, reinterpret_cast<std::byte*>(state.data()));
    specs_.push_back(spec);
    states_.push_back(std::move(state));
  }

  /// Advances one frame. Passes `batch` objects (1 to 64) at a time to the model, in the order of add() or backwards.
  void advance(std::size_t batch = 64, bool backwards = false) {
    std::vector<std::size_t> order(specs_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = backwards ? order.size() - 1 - i : i;
    moved_ = 0;
    std::vector<Pose> next(specs_.size());
    for (std::size_t from = 0; from < order.size(); from += batch) {
      const std::size_t size = std::min(batch, order.size() - from);
      std::vector<MotionInput> inputs(size);
      std::vector<MotionOutput> outputs(size);
      std::vector<std::vector<std::uint64_t>> states(size);
      for (std::size_t k = 0; k < size; ++k) {
        const std::size_t i = order[from + k];
        states[k] = states_[i];
        inputs[k].number = specs_[i].number;
        inputs[k].category = specs_[i].category;
        inputs[k].pose = specs_[i].pose;
        inputs[k].state = reinterpret_cast<const std::byte*>(states_[i].data());
        inputs[k].contacts = ObjectContacts(contacts_.data(), touching_[specs_[i].number]);
        outputs[k].pose = specs_[i].pose;
        outputs[k].state = reinterpret_cast<std::byte*>(states[k].data());
      }
      model_.move(frame_, inputs, outputs);
      for (std::size_t k = 0; k < size; ++k) {
        next[order[from + k]] = outputs[k].pose;
        states_[order[from + k]] = states[k];
      }
    }
    for (std::size_t i = 0; i < specs_.size(); ++i) {
      moved_ += !(specs_[i].pose == next[i]);
      specs_[i].pose = next[i];
    }
    find_contacts();
    ++frame_;
  }

  const std::vector<ObjectSpec>& objects() const { return specs_; }
  /// C(k), ordered by (a, b).
  const std::vector<Contact>& contacts() const { return contacts_; }
  /// Number of objects whose pose changed in the last frame.
  std::size_t moved() const { return moved_; }
  /// Number of frames so far.
  std::uint64_t frame() const { return frame_; }

 private:
  void find_contacts() {
    constexpr double cell = 2;
    std::map<std::tuple<int, int, int>, std::vector<std::size_t>> grid;
    const auto key = [](const Vec3d& p) {
      return std::tuple(static_cast<int>(std::floor(p.x / cell)), static_cast<int>(std::floor(p.y / cell)),
                        static_cast<int>(std::floor(p.z / cell)));
    };
    for (std::size_t i = 0; i < specs_.size(); ++i) grid[key(specs_[i].pose.position)].push_back(i);
    contacts_.clear();
    touching_.clear();
    for (std::size_t i = 0; i < specs_.size(); ++i) {
      const auto [x, y, z] = key(specs_[i].pose.position);
      for (int dx = -1; dx <= 1; ++dx) {
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dz = -1; dz <= 1; ++dz) {
            const auto found = grid.find({x + dx, y + dy, z + dz});
            if (found == grid.end()) continue;
            for (const std::size_t j : found->second) {
              if (specs_[i].number < specs_[j].number) test(specs_[i], specs_[j]);
            }
          }
        }
      }
    }
    std::sort(contacts_.begin(), contacts_.end(),
              [](const Contact& p, const Contact& q) { return std::tie(p.a, p.b) < std::tie(q.a, q.b); });
    for (std::size_t c = 0; c < contacts_.size(); ++c) {
      touching_[contacts_[c].a].push_back(static_cast<std::uint32_t>(c));
      touching_[contacts_[c].b].push_back(static_cast<std::uint32_t>(c));
    }
  }

  void test(const ObjectSpec& a, const ObjectSpec& b) {
    const Vec3d& p = a.pose.position;
    const Vec3d& q = b.pose.position;
    const double x = q.x - p.x, y = q.y - p.y, z = q.z - p.z;
    const double distance = std::sqrt(x * x + y * y + z * z);
    if (distance > 2 || distance == 0) return;
    Contact contact;
    contact.a = a.number;
    contact.b = b.number;
    contact.depth = static_cast<float>(2 - distance);
    contact.normal = {static_cast<float>(x / distance), static_cast<float>(y / distance),
                      static_cast<float>(z / distance)};
    contact.point = {(p.x + q.x) / 2, (p.y + q.y) / 2, (p.z + q.z) / 2};
    const auto arm = [&](const Vec3d& from) {
      return Vec3f{static_cast<float>(contact.point.x - from.x), static_cast<float>(contact.point.y - from.y),
                   static_cast<float>(contact.point.z - from.z)};
    };
    contact.arm_a = arm(p);
    contact.arm_b = arm(q);
    contacts_.push_back(contact);
  }

  const MotionModel& model_;
  std::uint64_t frame_ = 0;
  std::size_t moved_ = 0;
  std::vector<ObjectSpec> specs_;
  std::vector<std::vector<std::uint64_t>> states_;
  std::vector<Contact> contacts_;
  std::map<ObjectNumber, std::vector<std::uint32_t>> touching_;
};

}  // namespace ringfence::test
