// A small game server: players connect and leave, walk and push crates; drones fly by themselves. The output is the
// same for any number of nodes and in every deployment. Usage:
//
//   game_server [NODES [user|user-server|user-collision]]
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include <ringfence/digest.hpp>
#include <ringfence/world.hpp>

namespace {

using ringfence::Category;
using ringfence::Contact;
using ringfence::ObjectId;
using ringfence::Phase;
using ringfence::Pose;
using ringfence::Status;
using ringfence::UserId;
using ringfence::Vec3d;

constexpr double side = 40;   // of the arena, metres
constexpr double step = 0.2;  // of a player per frame, metres
constexpr int frames = 300;

// [rock]
/// A rock that players walk around: a pyramid of four triangles, open below. Meshes are surfaces.
ringfence::TriangleMesh rock() {
  ringfence::TriangleMesh mesh;
  mesh.vertices = {{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}, {0, 0, 3}};
  mesh.indices = {0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4};  // three per triangle
  return mesh;
}
// [rock]

/// Ends the program if the World has refused a call that it should accept.
void require_ok(Status status) {
  if (status != Status::ok) {
    std::fprintf(stderr, "game_server: the World refused a call: %s\n", name_of(status));
    std::exit(1);
  }
}

/// The translation in metres by which a contact pushes `self`, one of its two objects: `share` times the depth.
Vec3d push_of(const Contact& contact, ringfence::ObjectNumber self, double share) {
  const double length = (contact.a == self ? -share : share) * double{contact.depth};
  return {length * double{contact.normal.x}, length * double{contact.normal.y}, length * double{contact.normal.z}};
}

/// Moves all objects except the players: drones fly straight and bounce off obstacles; crates are pushed.
///
/// The threads that host the objects call it concurrently, so it is const, shares no state, and computes S(k) only from
/// its inputs.
class ArenaMotion final : public ringfence::MotionModel {
 public:
  struct State {
    Vec3d velocity;  ///< metres per frame
  };

  std::size_t state_bytes() const noexcept override { return sizeof(State); }

  void start(const ringfence::ObjectSpec& spec, std::byte* state) const override {
    State s;
    if (spec.category == Category::active) {
      const double turn = static_cast<double>(spec.number % 7) - 3;
      s.velocity = {0.05 * turn, 0.04 * (3 - turn), 0};
    }
    std::memcpy(state, &s, sizeof s);
  }

  // [model]
  void move(std::uint64_t, std::span<const ringfence::MotionInput> inputs,
            std::span<ringfence::MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const ringfence::MotionInput& in = inputs[i];
      if (!in.enabled || in.category == Category::avatar) {
        continue;  // without an output the object does not move
      }
      State s;
      std::memcpy(&s, in.state, sizeof s);
      Vec3d& p = outputs[i].pose.position;
      for (const Contact& contact : in.contacts) {
        const Vec3d push = push_of(contact, in.number, 0.5);
        p.x += push.x;
        p.y += push.y;
        if (s.velocity.x * push.x + s.velocity.y * push.y < 0) {
          s.velocity = {-s.velocity.x, -s.velocity.y, 0};
        }
      }
      p.x += s.velocity.x;
      p.y += s.velocity.y;
      s.velocity.x = p.x < 1 || p.x > side - 1 ? -s.velocity.x : s.velocity.x;
      s.velocity.y = p.y < 1 || p.y > side - 1 ? -s.velocity.y : s.velocity.y;
      p.x = std::clamp(p.x, 1.0, side - 1);
      p.y = std::clamp(p.y, 1.0, side - 1);
      std::memcpy(outputs[i].state, &s, sizeof s);
    }
  }
  // [model]
};

/// What the server stores for each player.
struct Player {
  ObjectId avatar;
  Pose pose;
  int walks_to = 0;      ///< the last input: one of four directions
  int bumps = 0;         ///< contacts that began
  std::size_t seen = 0;  ///< states of other players near this one, summed over all frames
};

class GameServer {
 public:
  explicit GameServer(const ringfence::WorldConfig& config) : world_(config) {
    const auto floor = world_.add_shape(ringfence::Box{{side / 2, side / 2, 0.5f}});
    const auto crate = world_.add_shape(ringfence::Box{{0.5f, 0.5f, 0.5f}});
    const auto drone = world_.add_shape(ringfence::Sphere{0.4f});
    person_ = world_.add_shape(ringfence::Capsule{0.3f, 0.6f});

    // Layer 0, the things, collides only with itself. Layer 1, the ground, collides with nothing.
    const auto add = [&](const ringfence::ObjectSpec& spec) { require_ok(world_.spawn(spec).status); };
    add({.shape = floor, .category = Category::fixed, .layer = 1, .pose = {{side / 2, side / 2, -0.5}, {}}});
    add({.shape = world_.add_shape(rock()), .category = Category::fixed, .pose = {{12, 19, 0}, {}}});
    for (int i = 0; i < 60; ++i) {
      const Vec3d at{2 + (i * 7) % 36 + 0.25, 2 + (i * 11) % 37 + 0.25, 0.5};
      add({.shape = crate, .category = Category::non_active, .pose = {at, {}}});
    }
    for (int i = 0; i < 40; ++i) {
      const Vec3d at{3.0 + (i * 13) % 34, 3.0 + (i * 5) % 34, 0.9};
      add({.shape = drone, .category = Category::active, .pose = {at, {}}});
    }
  }

  void join(Vec3d at) {
    const UserId user = world_.connect().user;
    Player player;
    player.pose.position = at;
    // The World passes user_data to the motion model, and World::object returns it.
    const ringfence::Spawned spawned = world_.spawn({.shape = person_,
                                                     .category = Category::avatar,
                                                     .user = user,
                                                     .user_data = user.number(),
                                                     .pose = player.pose});
    require_ok(spawned.status);
    player.avatar = spawned.id;
    players_[user] = player;
  }

  void leave(UserId user) {
    require_ok(world_.disconnect(user));  // also destroys the avatar
    std::printf("player %u leaves: %d bumps\n", user.number(), players_[user].bumps);
    players_.erase(user);
  }

  // [frame]
  void frame() {
    for (auto& [user, player] : players_) {
      walk(player);
      require_ok(world_.move(user, player.avatar, player.pose));
    }
    require_ok(world_.begin_frame());
    read_inputs();  // other work of the server, while the frame runs
    require_ok(world_.finish_frame());
    for (auto& [user, player] : players_) {
      answer(user, player);
    }
    digest_.add_frame(world_.contacts());
  }
  // [frame]

  /// A user tries to move the avatar of another user. The World refuses the call.
  void cheat(UserId cheater, UserId victim) {
    const Status status = world_.move(cheater, players_[victim].avatar, {});
    std::printf("player %u moves player %u: %s\n", cheater.number(), victim.number(), name_of(status));
  }

  void print() const {
    const ringfence::FrameReport& report = world_.report();
    for (const auto& [user, player] : players_) {
      const Vec3d p = world_.object(player.avatar).spec.pose.position;
      std::printf("player %u: %d bumps, stands at (%.2f, %.2f), saw %zu players\n", user.number(), player.bumps, p.x,
                  p.y, player.seen);
    }
    std::printf("frame %" PRIu64 ": %" PRIu64 " objects, %" PRIu64 " candidates, %" PRIu64 " contacts\n", report.frame,
                report.objects, report.candidates, report.contacts);
    std::printf("digest %016" PRIx64 "\n", digest_.value());
  }

 private:
  /// Reads the players' inputs. This example has no network: each player turns from time to time.
  void read_inputs() {
    for (auto& [user, player] : players_) {
      if ((world_.frames() + 13 * user.number()) % 40 == 0) {
        player.walks_to = (player.walks_to + 1 + static_cast<int>(user.number() % 2)) % 4;
      }
    }
  }

  static void walk(Player& player) {
    constexpr double directions[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    Vec3d& p = player.pose.position;
    p.x = std::clamp(p.x + step * directions[player.walks_to][0], 1.0, side - 1);
    p.y = std::clamp(p.y + step * directions[player.walks_to][1], 1.0, side - 1);
  }

  // [answer]
  void answer(UserId user, Player& player) {
    const ringfence::ObjectNumber self = player.avatar.number();
    for (const Contact& contact : world_.collisions_of(user)) {
      // In user domain deployment a user node hosts more than its avatar.
      if (contact.phase == Phase::end || (contact.a != self && contact.b != self)) {
        continue;
      }
      player.bumps += contact.phase == Phase::begin ? 1 : 0;
      const Vec3d push = push_of(contact, self, 1.0);
      player.pose.position.x += push.x;
      player.pose.position.y += push.y;
    }
    const Vec3d here = world_.object(player.avatar).spec.pose.position;
    for (const auto& run : world_.seen_by(user)) {
      for (const ringfence::SeenState& state : run) {
        // A server would send `state` to the client if it is near; this example counts the other players.
        const Vec3d& there = state.pose.position;
        const bool near = std::hypot(there.x - here.x, there.y - here.y) <= world_.config().interest;
        const bool avatar = std::any_of(players_.begin(), players_.end(), [&](const auto& other) {
          return other.second.avatar.number() == state.number;
        });
        player.seen += near && avatar ? 1 : 0;
      }
    }
  }
  // [answer]

  ringfence::World world_;
  ringfence::ShapeId person_;
  std::map<UserId, Player> players_;
  ringfence::Digest digest_;
};

// [config]
ringfence::WorldConfig configure(std::uint32_t nodes, ringfence::Deployment deployment) {
  ringfence::WorldConfig config;
  config.bounds_max = {side, side, 10};
  config.nodes = nodes;  // worker threads; 0 runs all roles in the calling thread
  config.deployment = deployment;
  config.interest = 10;  // metres around a player within which it sees other objects
  config.capacities.objects = 256;
  config.layers.names = {"things", "ground"};
  config.layers.collide = {{0, 0}};
  config.motion = std::make_shared<ArenaMotion>();
  config.log = [](ringfence::LogLevel, std::string_view line) {
    std::fprintf(stderr, "%.*s\n", static_cast<int>(line.size()), line.data());
  };
  return config;
}
// [config]

ringfence::Deployment deployment_of(std::string_view name) {
  for (const auto deployment : {ringfence::Deployment::user, ringfence::Deployment::user_server}) {
    if (name == name_of(deployment)) {
      return deployment;
    }
  }
  return ringfence::Deployment::user_collision;
}

}  // namespace

int main(int argc, char** argv) {
  const auto nodes = static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 2);
  GameServer server(configure(nodes, deployment_of(argc > 2 ? argv[2] : "user-collision")));
  server.join({10, 10, 0.9});
  server.join({14, 10, 0.9});
  server.join({20, 20, 0.9});
  for (int frame = 0; frame < frames; ++frame) {
    if (frame == 100) {
      server.leave(UserId(1));
    }
    if (frame == 150) {
      server.join({30, 12, 0.9});
    }
    if (frame == 200) {
      server.cheat(UserId(0), UserId(2));
    }
    server.frame();
  }
  server.print();
}
