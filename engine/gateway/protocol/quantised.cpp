#include "gateway/protocol/quantised.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::gateway {
namespace {

constexpr double max_steps = 0x1p62;
constexpr std::uint32_t component_bits = 10;
constexpr std::uint32_t component_mask = (1u << component_bits) - 1;
constexpr double sqrt_2 = 1.4142135623730951;

std::int64_t quanta_of(double metres) noexcept {
  return static_cast<std::int64_t>(std::nearbyint(std::clamp(metres / quantum, -max_steps, max_steps)));
}

std::int8_t signed_byte(float value) noexcept {
  return static_cast<std::int8_t>(std::nearbyint(std::clamp(value, -1.0f, 1.0f) * 127.0f));
}

}  // namespace

QuantisedPosition quantise(const Vec3d& position) noexcept {
  return {quanta_of(position.x), quanta_of(position.y), quanta_of(position.z)};
}

Vec3d position_of(const QuantisedPosition& position) noexcept {
  return {static_cast<double>(position.x) * quantum, static_cast<double>(position.y) * quantum,
          static_cast<double>(position.z) * quantum};
}

std::uint32_t quantise(const Quat& orientation) noexcept {
  const std::array<double, 4> q{orientation.x, orientation.y, orientation.z, orientation.w};
  std::uint32_t largest = 0;
  for (std::uint32_t i = 1; i < 4; ++i) {
    if (std::abs(q[i]) > std::abs(q[largest])) largest = i;
  }
  const double sign = q[largest] < 0 ? -1 : 1;
  std::uint32_t turn = largest << (3 * component_bits);
  std::uint32_t shift = 0;
  for (std::uint32_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const double share = std::clamp((sign * q[i] * sqrt_2 + 1) / 2, 0.0, 1.0);
    turn |= static_cast<std::uint32_t>(std::nearbyint(share * component_mask)) << shift;
    shift += component_bits;
  }
  return turn;
}

Quat orientation_of(std::uint32_t turn) noexcept {
  const std::uint32_t largest = turn >> (3 * component_bits);
  std::array<double, 4> q{};
  double squares = 0;
  for (std::uint32_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    q[i] = (static_cast<double>(turn & component_mask) / component_mask * 2 - 1) / sqrt_2;
    squares += q[i] * q[i];
    turn >>= component_bits;
  }
  // Three components of 1/sqrt(2) each are no rotation; they are read as the nearest one.
  q[largest] = std::sqrt(std::max(0.0, 1 - squares));
  const double length = std::sqrt(squares + q[largest] * q[largest]);
  return {static_cast<float>(q[0] / length), static_cast<float>(q[1] / length), static_cast<float>(q[2] / length),
          static_cast<float>(q[3] / length)};
}

QuantisedNormal quantise_normal(const Vec3f& normal) noexcept {
  return {signed_byte(normal.x), signed_byte(normal.y), signed_byte(normal.z)};
}

Vec3f normal_of(const QuantisedNormal& normal) noexcept {
  return {static_cast<float>(normal.x) / 127.0f, static_cast<float>(normal.y) / 127.0f,
          static_cast<float>(normal.z) / 127.0f};
}

}  // namespace ringfence::gateway
