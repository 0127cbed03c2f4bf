// Property: whatever clients send and whenever they come and go, frames go on, and every message to them can be read
// and applied. The input is a list of steps: a byte for what happens, and what it needs.
#include <memory>
#include <vector>

#include "fuzz/target.hpp"
#include "gateway/client/replica.hpp"
#include "gateway/clients/clients.hpp"
#include "gateway/clients/fake_transport.hpp"
#include "motion/walk.hpp"

using namespace ringfence;
using namespace ringfence::gateway;

namespace {

constexpr std::size_t max_frames = 24;
constexpr std::size_t max_connections = 6;

WorldConfig world_config() {
  WorldConfig config;
  config.nodes = 0;
  config.bounds_min = {-10, -10, 0};
  config.bounds_max = {10, 10, 3};
  config.interest = 5;
  motion::WalkConfig walk;
  walk.bounds_min = config.bounds_min;
  walk.bounds_max = config.bounds_max;
  config.motion = std::make_shared<motion::Walk>(walk);
  return config;
}

class Game {
 public:
  Game() : world_(world_config()), ball_(world_.add_shape(Sphere{0.5f})) {
    config_.hooks.spawn = [this](UserId user) {
      ObjectSpec spec;
      spec.shape = ball_;
      spec.category = Category::avatar;
      spec.user = user;
      spec.pose.position = {0.4 * user.number(), 0, 0.5};
      return world_.spawn(spec).id;
    };
    config_.hooks.application = [](UserId, std::span<const std::byte>) {};
    config_.grace_s = 0.1;
    for (ObjectNumber number = 100; number < 104; ++number) {
      ObjectSpec spec;
      spec.number = number;
      spec.shape = ball_;
      spec.category = number % 2 == 0 ? Category::fixed : Category::active;
      spec.pose.position = {2.0 * (number - 100), 1, 0.5};
      fuzz::require(world_.spawn(spec).status == Status::ok);
    }
    clients_ = std::make_unique<Clients>(world_, config_, transport_, [](UserId) { return std::string("token"); });
    frame();
  }

  void open(Role role, std::uint32_t user) {
    if (replicas_.size() >= max_connections) return;
    static_cast<void>(transport_.open(role, user == 0 ? no_user : UserId(user)));
    replicas_.emplace_back();
  }
  void close(std::size_t choice) {
    if (!replicas_.empty()) transport_.client_closes(1 + choice % replicas_.size());
  }
  void send(std::size_t choice, const std::vector<std::byte>& message) {
    if (!replicas_.empty()) transport_.client_sends_bytes(1 + choice % replicas_.size(), message);
  }
  void frame() {
    clients_->before_frame();
    fuzz::require(world_.advance() == Status::ok);
    clients_->after_frame();
    for (std::size_t i = 0; i < replicas_.size(); ++i) check_messages(i + 1, replicas_[i]);
  }

 private:
  void check_messages(ConnectionId connection, Replica& replica) {
    for (const auto& message : transport_.take(connection, ServerMessageType::update)) {
      fuzz::require(read(message, update_));
      fuzz::require(replica.apply(update_) != Replica::Outcome::invalid);
    }
    for (const auto& message : transport_.take(connection, ServerMessageType::shape)) {
      ShapeId id;
      std::optional<ShapeDescription> shape;
      fuzz::require(read_shape(message, id, shape));
    }
    for (const auto& message : transport_.take(connection, ServerMessageType::welcome)) {
      Welcome welcome;
      fuzz::require(read(message, welcome));
    }
  }

  World world_;
  ShapeId ball_;
  GatewayConfig config_;
  FakeTransport transport_;
  std::unique_ptr<Clients> clients_;
  std::vector<Replica> replicas_;
  Update update_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  Game game;
  std::size_t at = 0, frames = 0;
  const auto next = [&]() -> std::uint8_t { return at < size ? input[at++] : 0; };
  while (at < size && frames < max_frames) {
    const std::uint8_t step = next();
    switch (step & 7) {
      case 0:
        game.open(static_cast<Role>((step >> 3) % 3), next() % 8);
        break;
      case 1:
        game.close(next());
        break;
      case 2:
      case 3:
        ++frames;
        game.frame();
        break;
      default: {
        const std::size_t wanted = next() % 48;
        const std::size_t length = std::min(wanted, size - at);
        const auto* const first = reinterpret_cast<const std::byte*>(input + at);
        at += length;
        game.send(step >> 3, {first, first + length});
      }
    }
  }
  game.frame();
  return 0;
}
