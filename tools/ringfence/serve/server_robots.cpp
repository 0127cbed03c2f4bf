#include "serve/server_robots.hpp"

#include <fmt/format.h>

#include "motion/random.hpp"
#include "motion/walk.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t way_stream = 301;
constexpr std::uint64_t way_frames = 40;  // a robot keeps its direction for this number of frames
constexpr std::uint32_t max_robots = 10'000;

}  // namespace

bool ServerRobots::add() {
  // Numbers of robots that left are free again in the next frame at the earliest.
  const auto limit = static_cast<std::uint32_t>(world_.config().limits.users);
  for (std::uint32_t number = limit; number-- > limit - max_robots;) {
    const UserId user(number);
    if (world_.connect(user).status != Status::ok) continue;
    const ObjectId avatar = places_.spawn(user);
    if (!avatar) {
      static_cast<void>(world_.disconnect(user));
      return false;
    }
    robots_.push_back({user, avatar});
    return true;
  }
  return false;
}

std::string ServerRobots::resize(std::uint32_t count) {
  if (count > max_robots) return fmt::format("refused: found {} robots; expected 0 to {}", count, max_robots);
  while (robots_.size() > count) {
    static_cast<void>(world_.disconnect(robots_.back().user));
    robots_.pop_back();
  }
  while (robots_.size() < count && add()) {
  }
  if (robots_.size() < count) return fmt::format("the world has room for {} robots only", robots_.size());
  return fmt::format("the world has {} robots", robots_.size());
}

void ServerRobots::before_frame() {
  for (const Robot& robot : robots_) {
    const std::uint64_t epoch = (world_.frames() + robot.user.number() * 11ull) / way_frames;
    motion::Draws draws(1, way_stream, robot.user.number(), static_cast<std::uint32_t>(epoch));
    motion::WalkInput input;
    input.x = static_cast<std::int8_t>(draws.between(-127, 127));
    input.y = static_cast<std::int8_t>(draws.between(-127, 127));
    input.heading = static_cast<std::uint16_t>(draws.word());
    static_cast<void>(world_.input(robot.user, robot.avatar, input.bytes()));  // refused before it is in the world
  }
}

}  // namespace ringfence::tools
