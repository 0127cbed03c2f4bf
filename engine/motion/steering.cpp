#include "motion/steering.hpp"

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
struct Steering::State {
  Vec3f velocity;  ///< metres a frame
  Vec3f spin;      ///< radians a frame, about the world's axes
  Vec3f goal;      ///< relative to the centre of the bounds
  std::uint32_t reserved;
  std::uint64_t goal_until;  ///< first frame in which the goal may be elsewhere; 0: no goal yet
};

namespace {

enum Stream : std::uint32_t { relocation_times = 1, relocation_places, pick_times, pick_targets, pick_places, homes };

constexpr float agility = 0.12f;           // share of the difference to the wanted velocity that is added each frame
constexpr float stiffness = 0.3f;          // share of an overlap that each of the two objects removes in a frame
constexpr float approach_damping = 0.7f;   // share of the approach velocity that a contact removes in a frame
constexpr float push_to_velocity = 0.15f;  // share of a push that is added to the velocity of a non-active object
constexpr float non_active_slop = 0.125f;  // slop of non-active objects, relative to the configured one
constexpr float friction = 0.9f;           // share of velocity and spin that a non-active object keeps after a frame
constexpr float roll_per_metre = 0.35f;    // radians for each metre travelled
constexpr float lever_turn = 0.2f;         // radians a frame for an overlap of one metre at a lever of one metre
constexpr float spin_limit = 0.3f;  // radians a frame: the quaternion step below is accurate for small angles only
constexpr float rest_speed = 1.0f / 1024.0f;  // metres or radians a frame: a slower object is at rest

bool is_zero(const Vec3f& p) { return p.x == 0 && p.y == 0 && p.z == 0; }

/// The combined effect of all contacts of an object.
struct Response {
  Vec3f push;  ///< sum of the overlaps beyond the slop, along the normals
  Vec3f turn;  ///< sum of lever x overlap beyond the slop
};

/// Computes the response to all contacts, and damps the part of `velocity` that is directed towards the other objects.
Response respond(const MotionInput& input, float slop, Vec3f& velocity) {
  Response response;
  for (std::size_t i = 0; i < input.contacts.size(); ++i) {
    const Contact& contact = input.contacts[i];
    const bool is_a = contact.a == input.number;
    const Vec3f away = is_a ? -contact.normal : contact.normal;
    const float excess = contact.depth - slop;
    if (excess > 0) {
      const Vec3f& lever = is_a ? contact.arm_a : contact.arm_b;
      response.push = response.push + away * excess;
      response.turn = response.turn + cross(lever, away) * excess;
    }
    const float approach = dot(velocity, away);
    if (approach < 0) {
      velocity = velocity - away * (approach * approach_damping);
    }
  }
  return response;
}

/// One Euler step of dq/dt = spin * q / 2, then normalisation.
Quat rotated_by(const Quat& q, const Vec3f& spin) {
  const Vec3f h = spin * 0.5f;
  const Quat r{q.x + (h.x * q.w + h.y * q.z - h.z * q.y), q.y + (h.y * q.w + h.z * q.x - h.x * q.z),
               q.z + (h.z * q.w + h.x * q.y - h.y * q.x), q.w - (h.x * q.x + h.y * q.y + h.z * q.z)};
  const float inverse = 1.0f / std::sqrt(r.x * r.x + r.y * r.y + r.z * r.z + r.w * r.w);
  return {r.x * inverse, r.y * inverse, r.z * inverse, r.w * inverse};
}

/// Moves along one axis. At the bounds the object stops and its velocity on that axis becomes 0.
double clamped_step(double position, double step, double low, double high, float& velocity) {
  const double next = position + step;
  if (next < low || next > high) {
    velocity = 0;
    return std::clamp(next, low, high);
  }
  return next;
}

/// A coordinate in cells, uniform over the home cell, the cell before it and the cell after it. Reflected at the edge
/// of the lattice.
double place_near_home(std::uint32_t home, std::uint32_t lattice, float draw) {
  double place = static_cast<double>(home) - 1.0 + 3.0 * static_cast<double>(draw);
  if (place < 0) place = -place;
  if (place > lattice) place = 2.0 * lattice - place;
  return place;
}

/// The cell before `cell` on one axis, `cell` itself or the cell after it, with equal probability. At the edge of the
/// lattice `cell` itself replaces the missing cell.
std::uint32_t neighbour_cell(std::uint32_t cell, std::uint32_t lattice, std::uint32_t word) {
  const std::uint32_t step = uniform_below(3, word);
  if (step == 0) return cell == 0 ? 0 : cell - 1;
  if (step == 1) return cell;
  return std::min(cell + 1, lattice - 1);
}

/// The least number of cells on each axis with at least one cell for each target.
std::uint32_t lattice_for(std::uint32_t targets) {
  std::uint32_t lattice = 1;
  while (std::uint64_t{lattice} * lattice * lattice < targets) ++lattice;
  return lattice;
}

const SteeringConfig& checked(const SteeringConfig& config) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw Error(std::string("steering: ") + what);
  };
  const auto side = [](double low, double high) { return std::isfinite(low) && std::isfinite(high) && low < high; };
  const auto length = [](float value) { return std::isfinite(value) && value > 0; };
  require(side(config.bounds_min.x, config.bounds_max.x) && side(config.bounds_min.y, config.bounds_max.y) &&
              side(config.bounds_min.z, config.bounds_max.z),
          "bounds: expected finite min < max on each axis");
  require(config.targets >= 1 && config.targets <= 10'000'000, "targets: expected 1 to 10000000");
  require(length(config.speed), "speed: expected metres a frame, above 0");
  require(length(config.spread), "spread: expected metres, above 0");
  require(length(config.push), "push: expected metres, above 0");
  require(std::isfinite(config.slop) && config.slop >= 0, "slop: expected metres, 0 or more");
  return config;
}

}  // namespace

Steering::Steering(const SteeringConfig& config)
    : config_(checked(config)),
      relocations_(config.target_interval, config.seed, relocation_times),
      picks_(config.retarget_interval, config.seed, pick_times),
      lattice_side_(lattice_for(config.targets)) {
  static_assert(sizeof(State) == 48 && std::is_trivially_copyable_v<State> && sizeof(State) <= max_motion_state);
  const Vec3d& low = config.bounds_min;
  const Vec3d& high = config.bounds_max;
  centre_ = {(low.x + high.x) / 2, (low.y + high.y) / 2, (low.z + high.z) / 2};
  cell_size_ = {(high.x - low.x) / lattice_side_, (high.y - low.y) / lattice_side_, (high.z - low.z) / lattice_side_};
}

std::size_t Steering::state_bytes() const noexcept { return sizeof(State); }

std::uint64_t Steering::version() const noexcept {
  constexpr std::uint64_t algorithm = 1;
  std::uint64_t hash = algorithm;
  const auto add = [&](auto value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    hash = (hash ^ bits) * 0x100000001b3u + 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  };
  const SteeringConfig& c = config_;
  for (const Vec3d& corner : {c.bounds_min, c.bounds_max}) {
    add(corner.x), add(corner.y), add(corner.z);
  }
  add(c.seed), add(c.targets);
  add(c.target_interval.min), add(c.target_interval.max), add(c.retarget_interval.min), add(c.retarget_interval.max);
  add(c.speed), add(c.spread), add(c.slop), add(c.push);
  return hash;
}

Vec3d Steering::target_position(std::uint32_t target, std::uint64_t frame) const noexcept {
  const std::uint64_t cells = std::uint64_t{lattice_side_} * lattice_side_ * lattice_side_;
  // The first cell that pick_target maps to this target.
  const auto home = static_cast<std::uint32_t>((target * cells + config_.targets - 1) / config_.targets);
  Draws draws(config_.seed, relocation_places, target, relocations_.at(target, frame).number);
  const double x = place_near_home(home % lattice_side_, lattice_side_, draws.unit());
  const double y = place_near_home(home / lattice_side_ % lattice_side_, lattice_side_, draws.unit());
  const double z = place_near_home(home / lattice_side_ / lattice_side_, lattice_side_, draws.unit());
  return {config_.bounds_min.x + x * cell_size_.x, config_.bounds_min.y + y * cell_size_.y,
          config_.bounds_min.z + z * cell_size_.z};
}

std::uint64_t Steering::target_end(std::uint32_t target, std::uint64_t frame) const noexcept {
  return relocations_.at(target, frame).end;
}

std::uint32_t Steering::pick_target(ObjectNumber object, std::uint32_t epoch) const noexcept {
  Draws home(config_.seed, homes, object);
  Draws step(config_.seed, pick_targets, object, epoch);
  const std::uint64_t x = neighbour_cell(uniform_below(lattice_side_, home.word()), lattice_side_, step.word());
  const std::uint64_t y = neighbour_cell(uniform_below(lattice_side_, home.word()), lattice_side_, step.word());
  const std::uint64_t z = neighbour_cell(uniform_below(lattice_side_, home.word()), lattice_side_, step.word());
  const std::uint64_t cells = std::uint64_t{lattice_side_} * lattice_side_ * lattice_side_;
  // There are at least as many cells as targets; consecutive cells can share a target.
  return static_cast<std::uint32_t>(((z * lattice_side_ + y) * lattice_side_ + x) * config_.targets / cells);
}

Steering::Goal Steering::find_goal(ObjectNumber object, std::uint64_t frame) const noexcept {
  const SchedulePeriod pick = picks_.at(object, frame);
  const std::uint32_t target = pick_target(object, pick.number);
  Draws draws(config_.seed, pick_places, object, pick.number);
  Vec3f offset;
  do {  // rejection sampling in the unit ball: more than one draw in two is accepted
    offset = {draws.between(-1, 1), draws.between(-1, 1), draws.between(-1, 1)};
  } while (dot(offset, offset) > 1);
  const Vec3d place = target_position(target, frame) + to_double(offset * config_.spread);
  const Vec3d& low = config_.bounds_min;
  const Vec3d& high = config_.bounds_max;
  return {{std::clamp(place.x, low.x, high.x), std::clamp(place.y, low.y, high.y), std::clamp(place.z, low.z, high.z)},
          std::min(pick.end, target_end(target, frame))};
}

Vec3d Steering::goal_of(ObjectNumber object, std::uint64_t frame) const noexcept {
  return find_goal(object, frame).position;
}

void Steering::steer(const MotionInput& input, State& state) const noexcept {
  const Vec3f to_goal = to_float(to_double(state.goal) - (input.pose.position - centre_));
  // Full speed far from the goal. Slower where the distance is less than that of 8 frames at full speed.
  const float distance = length(to_goal);
  const float slowdown_distance = config_.speed * 8.0f;
  const float pace = config_.speed / std::max(distance, slowdown_distance);
  state.velocity = state.velocity + (to_goal * pace - state.velocity) * agility;
}

void Steering::move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const {
  const Vec3d& low = config_.bounds_min;
  const Vec3d& high = config_.bounds_max;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const MotionInput& input = inputs[i];
    if (!input.enabled || input.category == Category::fixed) {
      continue;
    }
    State state;
    std::memcpy(&state, input.state, sizeof state);

    const bool steers = input.category != Category::non_active;
    if (steers) {
      if (frame >= state.goal_until) {
        const Goal goal = find_goal(input.number, frame);
        state.goal = to_float(goal.position - centre_);
        state.goal_until = goal.end;
      }
      steer(input, state);
    } else if (input.contacts.empty() && is_zero(state.velocity) && is_zero(state.spin)) {
      continue;
    }

    Response response;
    if (!input.contacts.empty()) {
      response = respond(input, steers ? config_.slop : config_.slop * non_active_slop, state.velocity);
    }
    Vec3f push = with_max_length(response.push * stiffness, config_.push);
    // Each frame removes a share of the overlap, which would never end. So a push below the rest speed is dropped.
    if (dot(push, push) < rest_speed * rest_speed) push = {};
    if (steers) {
      const Vec3f rolling{-state.velocity.y * roll_per_metre, state.velocity.x * roll_per_metre,
                          state.velocity.z * roll_per_metre};
      state.spin = state.spin + (rolling - state.spin) * agility + response.turn * lever_turn;
    } else {
      state.velocity = (state.velocity + push * push_to_velocity) * friction;
      state.spin = (state.spin + response.turn * lever_turn) * friction;
      // Exactly zero, so that no update is sent for an object at rest.
      if (dot(state.velocity, state.velocity) < rest_speed * rest_speed) state.velocity = {};
      if (dot(state.spin, state.spin) < rest_speed * rest_speed) state.spin = {};
    }
    state.velocity = with_max_length(state.velocity, config_.speed * 2.0f);
    state.spin = with_max_length(state.spin, spin_limit);

    const Vec3f step = state.velocity + push;
    Pose& pose = outputs[i].pose;
    pose.position.x = clamped_step(pose.position.x, static_cast<double>(step.x), low.x, high.x, state.velocity.x);
    pose.position.y = clamped_step(pose.position.y, static_cast<double>(step.y), low.y, high.y, state.velocity.y);
    pose.position.z = clamped_step(pose.position.z, static_cast<double>(step.z), low.z, high.z, state.velocity.z);
    if (!is_zero(state.spin)) {
      pose.orientation = rotated_by(pose.orientation, state.spin);
    }
    std::memcpy(outputs[i].state, &state, sizeof state);
  }
}

}  // namespace ringfence::motion
