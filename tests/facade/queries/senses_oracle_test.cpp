// What motion models sense, compared with the reference in double precision.
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/sensing_model.hpp"
#include "reference/answer_check.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

using reference::AnswerCheck;
using reference::Question;

/// The reference knows filters by layer and by object only.
bool is_known(const QueryFilter& filter) { return filter.categories == ~0u && filter.except_group == 0; }

std::span<const Hit> list_of(const Hit& hit) { return {&hit, hit ? 1u : 0u}; }

/// What is wrong with the answers; empty if they are right. Refused queries have none. `right`: how many are right.
std::string describe_error(const AnswerCheck& check, const reference::Shapes& shapes, const SensedByObject& sensed,
                           std::size_t& right) {
  const auto ask = [&](Question::Kind kind, const reference::PreparedShape& shape, const Pose& start,
                       const Vec3d& displacement, double distance, Status status, std::span<const Hit> hits) {
    if (status != Status::ok) return std::string();
    ++right;
    const QueryFilter& filter = sensed.ray.filter;
    return check.describe_error({kind, {shape, start, displacement}, distance, filter.layers, filter.except.number()},
                                hits);
  };
  using enum Question::Kind;
  const Pose start{sensed.ray.start, {}};
  const reference::PreparedShape& moving = shapes[sensed.sweep.shape.number()];
  const reference::PreparedShape& placed = shapes[sensed.overlap.shape.number()];
  const reference::PreparedShape& point = reference::point_shape();
  return ask(first_hit, point, start, sensed.ray.displacement, 0, sensed.cast.status, list_of(sensed.cast)) +
         ask(first_hit, moving, sensed.sweep.start, sensed.sweep.displacement, 0, sensed.swept.status,
             list_of(sensed.swept)) +
         ask(overlap, placed, sensed.overlap.pose, {}, 0, sensed.overlap_status, sensed.overlaps) +
         ask(nearest, point, {sensed.nearest.point, {}}, {}, sensed.nearest.distance, sensed.near.status,
             list_of(sensed.near));
}

TEST_CASE("in every deployment and placement models sense what the reference finds in the frame before") {
  constexpr double side = 12;
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.sense = 4;
  in_all_worlds(base, {0u, 3u}, [&](WorldConfig config) {
    const auto model = std::make_shared<SensingModel>(side, config.sense);
    config.motion = model;
    World world(config);
    populate(world, 90, 3, side);
    const ShapeId walls =
        world.add_shape(TriangleMesh{{{-3, 0, -2}, {3, 0, -2}, {3, 0, 2}, {-3, 0, 2}}, {0, 1, 2, 0, 2, 3}});
    require_ok(world.spawn({.shape = walls, .category = Category::fixed, .pose = {{6, 6, 6}, {}}}).status);
    reference::Shapes shapes;
    for (std::uint32_t shape = 0; shape < world.shape_count(); ++shape) shapes.add(world.shape(ShapeId(shape)));
    advance(world);
    (void)model->take();  // in the first frame nothing can be sensed
    std::size_t right = 0;
    for (int frame = 1; frame < 10; ++frame) {
      std::vector<reference::FrameObject> objects;
      for (const ObjectView& view : world.objects()) {
        objects.push_back({view.spec.number, view.spec.shape.number(), view.spec.layer, view.spec.enabled,
                           view.spec.pose, view.spec.category == Category::fixed, view.spec.group, view.id.generation(),
                           view.spec.user_data, view.spec.user.number()});
      }
      const AnswerCheck check(shapes, objects);
      advance(world);
      for (const SensedByObject& sensed : model->take()) {
        CAPTURE(frame);
        CAPTURE(sensed.self.number());
        if (!is_known(sensed.ray.filter)) continue;
        const std::string error = describe_error(check, shapes, sensed, right);
        CHECK_MESSAGE(error.empty(), error);
      }
    }
    CHECK(right > 200);
  });
}

}  // namespace
}  // namespace ringfence::test
