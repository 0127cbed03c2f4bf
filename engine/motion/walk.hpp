#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "ringfence/motion_model.hpp"

namespace ringfence::motion {

/// Parameters of the model walk. Metres and seconds.
struct WalkConfig {
  Vec3d bounds_min{0, 0, 0};  ///< x and y of avatars and of active objects do not leave the bounds; finite
  Vec3d bounds_max{100, 100, 10};
  std::uint64_t seed = 1;   ///< of the ways of active objects
  float walk_speed = 2.5f;  ///< m/s, > 0
  float run_speed = 5.0f;   ///< m/s, >= walk_speed
  float push_speed = 2;     ///< m/s, >= 0: towards an object that gives way, at the first touch
  float acceleration = 20;  ///< m/s^2, > 0
  float step = 0.05f;       ///< seconds in a frame, > 0
};

/// Bit of ObjectSpec::user_data: the object gives way to those without it.
inline constexpr std::uint64_t gives_way = 1;

/// The input of an avatar; docs/client-protocol.md, "The input of the model walk".
struct WalkInput {
  std::int8_t x = 0, y = 0;   ///< wanted velocity; 127 is full speed
  std::uint16_t heading = 0;  ///< 65536 to a full turn, from +x towards +y
  bool runs = false;

  static constexpr std::size_t size = 5;  ///< bytes
  std::array<std::byte, size> bytes() const noexcept;
  /// Standing still, if the bytes are not an input.
  static WalkInput of(std::span<const std::byte> bytes) noexcept;
};

/// Moves in the plane z = constant. Avatars walk as their input says; active objects walk by themselves, in directions
/// that change every few seconds; non-active objects do not move by themselves. Everything stops at what it touches:
/// the speed towards it is removed, and half of the overlap beyond 2 cm is resolved in each frame. Objects that give
/// way are pushed instead: more slowly the more they overlap, and not beyond 12 cm; they resolve three quarters of the
/// overlap. An avatar without input slows down and stands.
///
/// The result is a pure function of configuration, frame, number, S(k-1), C(k-1) and input, computed with + - * / and
/// sqrt only: the same bits on every machine.
class Walk final : public MotionModel {
 public:
  /// Throws Error if a field is out of range; the message names it.
  explicit Walk(const WalkConfig& config);

  std::string_view name() const noexcept override { return "walk"; }
  std::uint64_t version() const noexcept override;
  std::size_t state_bytes() const noexcept override;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

  /// What clients need to predict it; docs/client-protocol.md.
  std::array<std::byte, 20> parameters() const noexcept;
  /// The configuration that has these parameters, without bounds and seed; none if the bytes are not parameters.
  static std::optional<WalkConfig> read_parameters(std::span<const std::byte> bytes) noexcept;
  const WalkConfig& config() const noexcept { return config_; }

 private:
  struct State;
  Vec3f wanted_velocity(std::uint64_t frame, const MotionInput& input, State& state) const noexcept;
  void move(std::uint64_t frame, const MotionInput& input, MotionOutput& output) const noexcept;

  WalkConfig config_;
};

/// The rotation about z by `heading`, 65536 to a full turn. The error is below 10^-6.
Quat rotation_of(std::uint16_t heading) noexcept;

}  // namespace ringfence::motion
