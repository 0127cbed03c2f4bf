// Frames of the facade compared with brute force in double precision.
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "reference/frame_check.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

TEST_CASE("in every deployment and placement the contacts and phases of random runs are those of brute force") {
  constexpr double side = 7;
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.interest = 3;
  base.layers.names = {"solid", "ghost", "wall"};
  base.layers.collide = {{0, 0}, {0, 2}, {1, 2}};
  base.motion = std::make_shared<BouncingModel>(side);
  base.quotas.colliding_avatars = 2;
  unsigned seed = 900;
  std::uint64_t unlisted = 0;
  in_all_worlds(base, {0u, 3u}, [&](WorldConfig config) {
    ++seed;
    config.deepest_contacts = seed % 3;
    CAPTURE(seed);
    World world(config);
    Script script(world, seed, side);
    reference::Shapes shapes;
    for (std::uint32_t shape = 0; shape < world.shape_count(); ++shape) shapes.add(world.shape(ShapeId(shape)));
    std::vector<std::uint32_t> masks;
    for (std::uint8_t layer = 0; layer < 3; ++layer) masks.push_back(config.layers.mask(layer));
    std::vector<Contact> before;
    for (std::uint64_t frame = 0; frame < 40; ++frame) {
      advance(world);
      std::vector<reference::FrameObject> objects;
      for (const ObjectView& view : world.objects()) {
        objects.push_back({view.spec.number, view.spec.shape.number(), view.spec.layer, view.spec.enabled,
                           view.spec.pose, view.spec.category == Category::fixed, view.spec.group, view.id.generation(),
                           view.spec.user_data, view.spec.user.number()});
      }
      reference::mark_excess(objects, config.quotas.colliding_avatars);
      for (const auto& difference :
           reference::check_frame(frame, shapes, objects, masks, world.contacts(), config.deepest_contacts)) {
        FAIL_CHECK(difference.text);
      }
      for (const auto& difference : reference::check_phases(frame, before, world.contacts(), world.ended())) {
        FAIL_CHECK(difference.text);
      }
      before.assign(world.contacts().begin(), world.contacts().end());
      unlisted += world.report().unlisted;
      script.make_requests();
    }
  });
  CHECK(unlisted > 300);
}

}  // namespace
}  // namespace ringfence::test
