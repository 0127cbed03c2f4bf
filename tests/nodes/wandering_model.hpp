#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "ringfence/motion_model.hpp"

namespace ringfence::nodes::test {

/// All objects wander over borders, rest now and then, keep a memory and respond to contacts, so that a lost state or
/// contact changes the result.
class WanderingModel : public MotionModel {
 public:
  /// Only the last eight bytes of the state are used; the rest makes it large.
  explicit WanderingModel(std::size_t bytes = 8) : bytes_(bytes) {}
  std::size_t state_bytes() const noexcept override { return bytes_; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if ((frame / 2 + inputs[i].number) % 4 == 0) {
        continue;
      }
      std::uint64_t memory;
      std::memcpy(&memory, inputs[i].state + bytes_ - sizeof memory, sizeof memory);
      for (std::size_t k = 0; k < inputs[i].contacts.size(); ++k) {
        memory = memory * 31 + inputs[i].contacts[k].a * 7 + inputs[i].contacts[k].b;
      }
      memory = memory * 6364136223846793005u + frame + inputs[i].number;
      std::memcpy(outputs[i].state + bytes_ - sizeof memory, &memory, sizeof memory);
      const auto step = [&](int shift) { return static_cast<double>(memory >> shift & 15) - 7.5; };
      Vec3d& p = outputs[i].pose.position;
      p = {p.x + step(20), p.y + step(30), p.z + step(40)};
      for (double* x : {&p.x, &p.y, &p.z}) {
        *x = *x < 2 ? 2 : *x > 62 ? 62 : *x;
      }
    }
  }

 private:
  std::size_t bytes_;
};

}  // namespace ringfence::nodes::test
