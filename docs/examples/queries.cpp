// The recipes of docs/queries.md. Usage: queries RECIPE
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string_view>
#include <vector>

#include <ringfence/world.hpp>

namespace {

using namespace ringfence;

void require_ok(Status status) {
  if (status == Status::ok) return;
  std::fprintf(stderr, "refused: %s\n", name_of(status));
  std::exit(1);
}

ObjectId spawn(World& world, const ObjectSpec& spec) {
  const Spawned spawned = world.spawn(spec);
  require_ok(spawned.status);
  return spawned.id;
}

/// Walks along y by 0.5 m a frame.
class Walk : public MotionModel {
 public:
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) outputs[i].pose.position.y += 0.5;
  }
};

void hit_scan_with_lag_compensation() {
  // [lag]
  WorldConfig config;
  config.history = 20;  // a second at 20 frames a second
  config.motion = std::make_shared<Walk>();
  World world(config);
  const ShapeId body = world.add_shape(Capsule{0.4f, 0.5f});
  const ObjectId runner = spawn(world, {.shape = body, .pose = {{30, 0, 1}, {}}});
  for (int frame = 0; frame < 20; ++frame) require_ok(world.advance());

  // The shooter aimed at what it saw 130 ms ago, which is 2.6 frames.
  const Snapshot now = world.snapshot();
  const double seen = static_cast<double>(now.frame()) - 2.6;
  const RayQuery shot{.start = {0, 8.7, 1}, .displacement = {50, 0, 0}, .frame = seen};
  const Hit then = now.cast(shot);
  std::printf("in frame %.1f the shot hits %s\n", seen, then.object == runner ? "the runner" : "nothing");
  const Hit late = now.cast({.start = shot.start, .displacement = shot.displacement});
  std::printf("in frame %llu it hits %s\n", static_cast<unsigned long long>(now.frame()),
              late ? "the runner" : "nothing");
  // [lag]
}

void sweep_a_projectile() {
  // [projectile]
  World world((WorldConfig()));
  const ShapeId plate = world.add_shape(Box{{0.01f, 5, 5}}), bullet = world.add_shape(Sphere{0.005f});
  const ObjectId wall = spawn(world, {.shape = plate, .category = Category::fixed, .pose = {{60, 50, 5}, {}}});
  require_ok(world.advance());

  // 900 m/s at 20 frames a second: 45 m a frame, and a wall of 2 cm.
  Vec3d position{0, 50, 5};
  const Vec3d step{45, 0, 0};
  for (int frame = 0; frame < 3; ++frame) {
    const Hit hit = world.snapshot().sweep({.shape = bullet, .start = {position, {}}, .displacement = step});
    if (hit.object == wall) {
      std::printf("frame %d: hits the wall at x = %.3f\n", frame, hit.point.x);
      break;
    }
    position.x += step.x;
    require_ok(world.advance());
  }
  // [projectile]
}

void check_lines_of_sight() {
  // [sight]
  World world((WorldConfig()));
  const ShapeId body = world.add_shape(Sphere{0.5f}), pillar = world.add_shape(Box{{1, 1, 5}});
  const ObjectId player = spawn(world, {.shape = body, .category = Category::fixed, .pose = {{50, 50, 1}, {}}});
  for (int i = 0; i < 8; ++i) {
    const double x = 50 + 10 * std::cos(i * 0.785), y = 50 + 10 * std::sin(i * 0.785);
    (void)spawn(world, {.shape = pillar, .category = Category::fixed, .pose = {{x, y, 5}, {}}});
  }
  std::vector<ObjectId> monsters;
  for (int i = 0; i < 1000; ++i) {
    const double angle = i * 0.00628, x = 50 + 30 * std::cos(angle), y = 50 + 30 * std::sin(angle);
    monsters.push_back(spawn(world, {.shape = body, .category = Category::non_active, .pose = {{x, y, 1}, {}}}));
  }
  require_ok(world.advance());

  // Only static objects hide the player; the player itself does not.
  const Vec3d target = world.object(player).spec.pose.position;
  std::vector<RayQuery> lines;
  for (const ObjectId monster : monsters) {
    const Vec3d eye = world.object(monster).spec.pose.position;
    lines.push_back({.start = eye,
                     .displacement = {target.x - eye.x, target.y - eye.y, target.z - eye.z},
                     .filter = {.categories = bit_of(Category::fixed), .except = player}});
  }
  std::vector<AnyHit> hidden(lines.size());
  world.snapshot().cast_any(lines, hidden);
  int seeing = 0;
  for (const AnyHit& hit : hidden) seeing += hit ? 0 : 1;
  std::printf("%d of %zu monsters see the player\n", seeing, monsters.size());
  // [sight]
}

void swing_a_sword() {
  // [melee]
  World world((WorldConfig()));
  const ShapeId body = world.add_shape(Capsule{0.4f, 0.5f}), blade = world.add_shape(Box{{0.6f, 0.05f, 0.05f}});
  const ObjectId fighter = spawn(world, {.shape = body, .group = 1, .pose = {{10, 10, 1}, {}}});
  for (const double y : {9.4, 10.2, 12.0})
    (void)spawn(world, {.shape = body, .user_data = 7, .pose = {{11.2, y, 1}, {}}});
  require_ok(world.advance());

  // The blade moves from right to left in front of the fighter; it hits each object once, the nearest first.
  HitLists hits;
  const SweepQuery swing{
      .shape = blade, .start = {{11.2, 8.5, 1}, {}}, .displacement = {0, 3, 0}, .filter = {.except = fighter}};
  world.snapshot().sweep_all({&swing, 1}, hits);
  for (const Hit& hit : hits[0]) std::printf("object %u at %.2f of the swing\n", hit.object.number(), hit.fraction);
  // [melee]
}

void find_who_is_in_a_zone() {
  // [zone]
  World world((WorldConfig()));
  const ShapeId body = world.add_shape(Sphere{0.5f}), zone = world.add_shape(Box{{5, 5, 2}});
  for (int i = 0; i < 10; ++i) (void)spawn(world, {.shape = body, .pose = {{10.0 + 3 * i, 20, 1}, {}}});
  require_ok(world.advance());

  HitLists inside;
  const OverlapQuery question{.shape = zone, .pose = {{20, 20, 2}, {}}};
  world.snapshot().overlap({&question, 1}, inside);
  std::printf("%zu objects in the zone, the first is %u\n", inside[0].size(), inside[0][0].object.number());
  // [zone]
}

void find_who_is_near() {
  // [near]
  World world((WorldConfig()));
  const ShapeId body = world.add_shape(Sphere{0.5f});
  const ObjectId medic = spawn(world, {.shape = body, .pose = {{10, 10, 1}, {}}});
  for (const double x : {30.0, 18.0, 14.5}) (void)spawn(world, {.shape = body, .pose = {{x, 10, 1}, {}}});
  require_ok(world.advance());

  const Vec3d here = world.object(medic).spec.pose.position;
  const Hit nearest = world.snapshot().nearest({.point = here, .distance = 10, .filter = {.except = medic}});
  std::printf("object %u is %.1f m away\n", nearest.object.number(), nearest.distance);
  // [near]
}

void find_the_ground() {
  // [ground]
  World world((WorldConfig()));
  const ShapeId slope =
      world.add_shape(TriangleMesh{{{0, 0, 0}, {100, 0, 20}, {100, 100, 20}, {0, 100, 0}}, {0, 1, 2, 0, 2, 3}});
  const ShapeId body = world.add_shape(Sphere{0.5f});
  (void)spawn(world, {.shape = slope, .category = Category::fixed});
  const ObjectId character = spawn(world, {.shape = body, .pose = {{40, 30, 12}, {}}});
  require_ok(world.advance());

  // Straight down, from a little above the feet.
  const Vec3d feet = world.object(character).spec.pose.position;
  const Hit ground = world.snapshot().cast({.start = {feet.x, feet.y, feet.z + 0.5},
                                            .displacement = {0, 0, -100},
                                            .filter = {.categories = bit_of(Category::fixed)}});
  std::printf("ground at %.2f m, triangle %u, normal upwards by %.2f\n", ground.point.z, ground.triangle,
              ground.normal.z);
  // [ground]
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view recipe = argc > 1 ? argv[1] : "";
  if (recipe == "lag") {
    hit_scan_with_lag_compensation();
  } else if (recipe == "projectile") {
    sweep_a_projectile();
  } else if (recipe == "sight") {
    check_lines_of_sight();
  } else if (recipe == "melee") {
    swing_a_sword();
  } else if (recipe == "zone") {
    find_who_is_in_a_zone();
  } else if (recipe == "near") {
    find_who_is_near();
  } else if (recipe == "ground") {
    find_the_ground();
  } else {
    std::printf("usage: queries lag|projectile|sight|melee|zone|near|ground\n");
    return 2;
  }
}
