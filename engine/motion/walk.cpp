#include "motion/walk.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <type_traits>

#include "geometry/vector.hpp"
#include "motion/random.hpp"
#include "ringfence/error.hpp"

namespace ringfence::motion {

/// The part of S(k) that the pose does not contain.
struct Walk::State {
  Vec3f velocity;  ///< m/s
  float heading;   ///< radians
};

namespace {

constexpr std::uint32_t way_stream = 101;
constexpr std::uint64_t way_frames = 64;    // an active object keeps its direction for this number of frames
constexpr float slop = 0.02f;               // metres: overlap that is not resolved, so that a contact persists
constexpr float resolved_share = 0.5f;      // of the overlap beyond the slop, in a frame, by each of two equal objects
constexpr float yielded_share = 0.75f;      // by an object that gives way; 1 would swing between two that push it
constexpr float push_depth = 0.12f;         // metres: overlap with an object that gives way, at which pushing ends
constexpr float least_plane_length = 0.1f;  // of a normal in the plane: flatter contacts are floors
constexpr float radians_per_step = 9.58737992e-5f;  // 2 pi / 65536
constexpr float full_input = 127;

void check(bool is_valid, const char* what) {
  if (!is_valid) throw Error(std::string("walk: ") + what);
}

const WalkConfig& checked(const WalkConfig& config) {
  const auto side = [](double low, double high) { return std::isfinite(low) && std::isfinite(high) && low < high; };
  const auto positive = [](float value) { return std::isfinite(value) && value > 0; };
  check(side(config.bounds_min.x, config.bounds_max.x) && side(config.bounds_min.y, config.bounds_max.y),
        "bounds: expected finite min < max on x and y");
  check(positive(config.walk_speed), "walk_speed: expected m/s, above 0");
  check(positive(config.run_speed) && config.run_speed >= config.walk_speed,
        "run_speed: expected m/s, at least walk_speed");
  check(std::isfinite(config.push_speed) && config.push_speed >= 0, "push_speed: expected m/s, at least 0");
  check(positive(config.acceleration), "acceleration: expected m/s^2, above 0");
  check(positive(config.step), "step: expected seconds, above 0");
  return config;
}

/// What the contacts of an object do to it.
struct WalkResponse {
  Vec3f push;      ///< metres
  Vec3f velocity;  ///< m/s
};

WalkResponse respond(const MotionInput& input, Vec3f velocity, float push_speed) {
  WalkResponse response{{}, velocity};
  const bool is_pushed = (input.user_data & gives_way) != 0;
  for (const Contact& contact : input.contacts) {
    Vec3f away = contact.a == input.number ? -contact.normal : contact.normal;
    away.z = 0;
    const float length = std::sqrt(dot(away, away));
    if (length < least_plane_length) continue;
    away = away * (1 / length);
    const std::uint64_t other = contact.a == input.number ? contact.user_data_b : contact.user_data_a;
    const bool pushes = !is_pushed && (other & gives_way) != 0;
    const float allowed = pushes ? push_speed * std::max(0.0f, 1 - contact.depth / push_depth) : 0;
    const float approach = dot(response.velocity, away) + allowed;
    if (approach < 0) response.velocity = response.velocity - away * approach;
    const float kept = pushes ? push_depth : slop;
    const float share = is_pushed && (other & gives_way) == 0 ? yielded_share : resolved_share;
    if (contact.depth > kept) response.push = response.push + away * ((contact.depth - kept) * share);
  }
  return response;
}

/// A direction in the plane of length 1, for each object and stretch of time another.
Vec3f way_of(std::uint64_t seed, ObjectNumber number, std::uint64_t frame) {
  // Objects change their directions at different times.
  Draws draws(seed, way_stream, number, static_cast<std::uint32_t>((frame + number * 37ull) / way_frames));
  for (int i = 0; i < 8; ++i) {
    const Vec3f v{draws.unit() * 2 - 1, draws.unit() * 2 - 1, 0};
    const float squared = dot(v, v);
    if (squared > 0.01f && squared <= 1) return v * (1 / std::sqrt(squared));
  }
  return {1, 0, 0};
}

/// The heading of a direction of length 1, as a rotation about z.
Quat rotation_to(const Vec3f& direction) {
  const float c = std::sqrt(std::max(0.0f, (1 + direction.x) * 0.5f));
  const float s = std::sqrt(std::max(0.0f, (1 - direction.x) * 0.5f));
  return {0, 0, direction.y < 0 ? -s : s, c};
}

}  // namespace

// The angle is reduced to a quarter turn, in which the sine's series to the 9th degree is exact to 4e-9.
Quat rotation_of(std::uint16_t heading) noexcept {
  const auto sine = [](std::uint32_t step) {  // of half steps: 131072 to a full turn
    step &= 131071;
    const bool is_negative = step >= 65536;
    step &= 65535;
    if (step > 32768) step = 65536 - step;
    const double x = step * (3.14159265358979323846 / 65536), q = x * x;
    const double value = x * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72 * (1 - q / 110)))));
    return is_negative ? -value : value;
  };
  return {0, 0, static_cast<float>(sine(heading)), static_cast<float>(sine(heading + 32768u))};
}

std::array<std::byte, WalkInput::size> WalkInput::bytes() const noexcept {
  return {static_cast<std::byte>(x), static_cast<std::byte>(y), static_cast<std::byte>(heading & 0xff),
          static_cast<std::byte>(heading >> 8), static_cast<std::byte>(runs ? 1 : 0)};
}

WalkInput WalkInput::of(std::span<const std::byte> bytes) noexcept {
  WalkInput input;
  if (bytes.size() != size) return input;
  input.x = static_cast<std::int8_t>(bytes[0]);
  input.y = static_cast<std::int8_t>(bytes[1]);
  input.heading =
      static_cast<std::uint16_t>(static_cast<std::uint16_t>(bytes[2]) | static_cast<std::uint16_t>(bytes[3]) << 8);
  input.runs = (bytes[4] & std::byte{1}) != std::byte{0};
  return input;
}

Walk::Walk(const WalkConfig& config) : config_(checked(config)) {
  static_assert(sizeof(State) == 16 && std::is_trivially_copyable_v<State> && sizeof(State) <= max_motion_state);
}

std::size_t Walk::state_bytes() const noexcept { return sizeof(State); }

std::uint64_t Walk::version() const noexcept {
  std::uint64_t hash = 2;  // of the algorithm
  const auto add = [&](auto value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    hash = (hash ^ bits) * 0x100000001b3u + 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  };
  add(config_.bounds_min.x), add(config_.bounds_min.y), add(config_.bounds_max.x), add(config_.bounds_max.y);
  add(config_.seed), add(config_.walk_speed), add(config_.run_speed), add(config_.acceleration), add(config_.step);
  add(config_.push_speed);
  return hash;
}

std::array<std::byte, 20> Walk::parameters() const noexcept {
  const std::array<float, 5> values{config_.walk_speed, config_.run_speed, config_.acceleration, config_.step,
                                    config_.push_speed};
  std::array<std::byte, 20> bytes{};
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

std::optional<WalkConfig> Walk::read_parameters(std::span<const std::byte> bytes) noexcept {
  std::array<float, 5> values{};
  if (bytes.size() != sizeof values) return std::nullopt;
  std::memcpy(values.data(), bytes.data(), sizeof values);
  WalkConfig config;
  config.walk_speed = values[0];
  config.run_speed = values[1];
  config.acceleration = values[2];
  config.step = values[3];
  config.push_speed = values[4];
  return config;
}

Vec3f Walk::wanted_velocity(std::uint64_t frame, const MotionInput& input, State& state) const noexcept {
  if (input.category == Category::active) return way_of(config_.seed, input.number, frame) * config_.walk_speed;
  if (input.category != Category::avatar || input.input.size() != WalkInput::size) return {};
  const WalkInput wish = WalkInput::of(input.input);
  state.heading = static_cast<float>(wish.heading) * radians_per_step;
  const Vec3f share = with_max_length(Vec3f{static_cast<float>(wish.x), static_cast<float>(wish.y), 0}, full_input);
  return share * ((wish.runs ? config_.run_speed : config_.walk_speed) / full_input);
}

void Walk::move(std::uint64_t frame, const MotionInput& input, MotionOutput& output) const noexcept {
  if (!input.enabled) return;
  State state;
  std::memcpy(&state, input.state, sizeof state);
  const Vec3f wanted = wanted_velocity(frame, input, state);
  const Vec3f change = with_max_length(wanted - state.velocity, config_.acceleration * config_.step);
  const WalkResponse response = respond(input, state.velocity + change, config_.push_speed);
  state.velocity = response.velocity;
  const Vec3f way = response.push + state.velocity * config_.step;
  Vec3d& position = output.pose.position;
  if (way.x != 0) position.x = std::clamp(position.x + way.x, config_.bounds_min.x, config_.bounds_max.x);
  if (way.y != 0) position.y = std::clamp(position.y + way.y, config_.bounds_min.y, config_.bounds_max.y);
  if (input.category == Category::active) {
    output.pose.orientation = rotation_to(way_of(config_.seed, input.number, frame));
  } else if (input.input.size() == WalkInput::size && input.category == Category::avatar) {
    output.pose.orientation = rotation_of(WalkInput::of(input.input).heading);
  }
  std::memcpy(output.state, &state, sizeof state);
}

void Walk::move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const {
  for (std::size_t i = 0; i < inputs.size(); ++i) move(frame, inputs[i], outputs[i]);
}

}  // namespace ringfence::motion
