#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "ringfence/motion_model.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes::test {

inline double wave(std::uint64_t n) { return static_cast<double>((n * 0x9e3779b97f4a7c15u) >> 40) / 0x1000000 - 0.5; }

/// Groups of eight that drift together, so that pairs cross borders while in contact; some disappear now and then, some
/// rest.
class DriftingModel : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 0; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const std::uint64_t number = inputs[i].number;
      outputs[i].enabled = number % 11 != 5 || (frame + number) % 9 > 1;
      if ((frame / 4 + number) % 6 == 0) {
        continue;
      }
      const std::uint64_t drift = (number / 8 * 977 + frame / 10) * 3;
      const std::uint64_t own = (number * 131 + frame) * 3 + 1'000'000;
      Vec3d& p = outputs[i].pose.position;
      p = {p.x + 3 * wave(drift) + 0.8 * wave(own), p.y + 3 * wave(drift + 1) + 0.8 * wave(own + 1),
           p.z + 3 * wave(drift + 2) + 0.8 * wave(own + 2)};
      for (double* x : {&p.x, &p.y, &p.z}) {
        *x = *x < 1 ? 1 : *x > 63 ? 63 : *x;
      }
    }
  }
};

}  // namespace ringfence::nodes::test
