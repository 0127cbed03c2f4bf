#include "gateway/client/prediction.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/client/replica.hpp"
#include "gateway/clients/clients.hpp"
#include "gateway/clients/fake_transport.hpp"
#include "motion/walk.hpp"

namespace ringfence::gateway {
namespace {

using Bytes = std::vector<std::byte>;

motion::WalkConfig walk_config() {
  motion::WalkConfig config;
  config.bounds_min = {-50, -50, 0};
  config.bounds_max = {50, 50, 3};
  return config;
}

motion::WalkInput wish(int x, int y) {
  motion::WalkInput input;
  input.x = static_cast<std::int8_t>(x);
  input.y = static_cast<std::int8_t>(y);
  input.runs = true;
  return input;
}

/// A world with a wall at x = 5 and a crate that gives way at x = -5, and one client that predicts its avatar. Messages
/// arrive a number of frames after they were sent.
class Predicted {
 public:
  explicit Predicted(int delay, Vec3d start = {})
      : walk_(walk_config()),
        world_(world_config()),
        ball_(world_.add_shape(Sphere{0.35f})),
        config_(gateway_config(start)),
        clients_(world_, config_, transport_, [](UserId) { return std::string(); }),
        obstacles_([](const Replica::Object& object) {
          return object.category == Category::non_active ? motion::gives_way : 0;
        }),
        prediction_(walk_, obstacles_),
        up_(static_cast<std::size_t>(delay)),
        down_(static_cast<std::size_t>(delay)) {
    spawn(100, Box{{0.5f, 20, 2}}, Category::fixed, {5, 0, 0}, 0);
    spawn(101, Box{{0.5f, 0.5f, 0.5f}}, Category::non_active, {-5, 0, 0}, motion::gives_way);
    connection_ = transport_.open(Role::play);
    for (int i = 0; i < 3; ++i) frame();
  }

  /// One frame of the server, and one of the client with this input. `is_lost`: the input does not arrive.
  void frame(const motion::WalkInput& input = {}, bool is_lost = false) {
    clients_.before_frame();
    REQUIRE(world_.advance() == Status::ok);
    clients_.after_frame();
    down_.push_back(transport_.take(connection_, ServerMessageType::update));
    for (const Bytes& message : std::exchange(down_.front(), {})) receive(message);
    down_.pop_front();
    send(input, is_lost);
  }
  /// The last difference between prediction and update.
  std::optional<double> error() const { return error_; }
  const Pose& predicted() const { return *prediction_.pose(); }
  Vec3d actual() const { return replica_.own()->pose.position; }
  std::size_t waiting_ticks() const { return prediction_.waiting_ticks(); }

 private:
  WorldConfig world_config() {
    WorldConfig config;
    config.nodes = 0;
    config.bounds_min = walk_config().bounds_min;
    config.bounds_max = walk_config().bounds_max;
    config.interest = 20;
    config.motion = std::make_shared<motion::Walk>(walk_config());
    return config;
  }
  GatewayConfig gateway_config(const Vec3d& start) {
    GatewayConfig config;
    config.hooks.spawn = [this, start](UserId user) {
      ObjectSpec spec;
      spec.shape = ball_;
      spec.category = Category::avatar;
      spec.user = user;
      spec.pose.position = start;
      return world_.spawn(spec).id;
    };
    return config;
  }
  void spawn(ObjectNumber number, const ShapeDescription& shape, Category category, const Vec3d& position,
             std::uint64_t user_data) {
    ObjectSpec spec;
    spec.number = number;
    spec.shape = world_.add_shape(shape);
    spec.category = category;
    spec.pose.position = position;
    spec.user_data = user_data;
    REQUIRE(world_.spawn(spec).status == Status::ok);
    obstacles_.add(spec.shape, shape);
    obstacles_.add(ball_, Sphere{0.35f});
  }
  void receive(const Bytes& message) {
    REQUIRE(read(message, update_));
    if (replica_.apply(update_) == Replica::Outcome::applied) error_ = prediction_.reconcile(update_, replica_);
  }
  void send(const motion::WalkInput& input, bool is_lost) {
    const auto body = input.bytes();
    if (sequence_ == 0 || body != last_) ++sequence_;
    last_ = body;
    prediction_.tick(sequence_, body);
    Bytes message;
    write(Input{replica_.acknowledgement(), sequence_, 0, body}, message);
    up_.push_back(is_lost ? Bytes() : message);
    if (!up_.front().empty()) transport_.client_sends_bytes(connection_, up_.front());
    up_.pop_front();
  }

  motion::Walk walk_;
  World world_;
  ShapeId ball_;
  GatewayConfig config_;
  FakeTransport transport_;
  Clients clients_;
  Obstacles obstacles_;
  Prediction prediction_;
  ConnectionId connection_ = 0;
  std::deque<Bytes> up_;
  std::deque<std::vector<Bytes>> down_;
  Replica replica_;
  Update update_;
  std::array<std::byte, motion::WalkInput::size> last_{};
  std::uint64_t sequence_ = 0;
  std::optional<double> error_;
};

}  // namespace

TEST_CASE("with any delay, the prediction has the bits of the server where nothing is touched") {
  for (const int delay : {0, 1, 4}) {
    for (const int kept : {1, 3}) {  // frames for which an input is kept
      Predicted client(delay, {0, 30, 0});
      std::mt19937 random(7);
      std::uniform_int_distribution<int> part(-127, 127);
      motion::WalkInput input;
      int compared = 0;
      for (int frame = 0; frame < 200; ++frame) {
        if (frame % kept == 0) input = wish(part(random), part(random));
        client.frame(input);
        if (frame < 4 * delay + 4) continue;
        REQUIRE(client.error().has_value());
        CHECK(*client.error() == 0);
        CHECK(client.waiting_ticks() == static_cast<std::size_t>(2 * delay + 1));
        ++compared;
      }
      CHECK(compared > 150);
    }
  }
}

TEST_CASE("a prediction walks to a wall and not through it") {
  Predicted client(4);
  double worst = 0, farthest = 0;
  for (int frame = 0; frame < 80; ++frame) {
    client.frame(wish(127, 20));
    if (frame < 20) continue;
    worst = std::max(worst, client.error().value());
    farthest = std::max(farthest, client.predicted().position.x);
  }
  CHECK(client.actual().x > 4);
  CHECK(farthest < 4.5 - 0.35 + 0.3);  // a step at full speed is 0.25 m
  CHECK(worst < 0.05);
}

TEST_CASE("a prediction stops at a crate, and starts again from the server when that one pushes it") {
  Predicted client(3);
  double worst = 0;
  for (int frame = 0; frame < 100; ++frame) {
    client.frame(wish(-127, 0));
    if (frame >= 20) worst = std::max(worst, client.error().value());
  }
  CHECK(client.actual().x < -4.3);  // it touches the crate at -4.15 and has pushed it
  CHECK(worst < 0.5);
}

TEST_CASE("after inputs were lost, the prediction is that of the server again") {
  Predicted client(2, {0, -30, 0});
  std::mt19937 random(3);
  std::uniform_int_distribution<int> part(-127, 127);
  for (int frame = 0; frame < 100; ++frame) client.frame(wish(part(random), part(random)), random() % 3 == 0);
  for (int frame = 0; frame < 10; ++frame) client.frame(wish(50, 60));
  CHECK(client.error().value() == 0);
}

}  // namespace ringfence::gateway
