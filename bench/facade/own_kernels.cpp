#include "facade/own_kernels.hpp"

#include <algorithm>

#include "geometry/vector.hpp"

namespace ringfence::bench {

Crowd::Crowd(const RecordedWorld& world)
    : world_(world),
      bodies_(world.objects()),
      bounds_(world.objects()),
      present_(world.objects(), 1),
      resting_(world.objects(), 0) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    bodies_[i].shape = world.scene.objects[i].shape.number();
    bodies_[i].number = static_cast<ObjectNumber>(i + 1);
  }
  place(world.frames[0], 0, bodies_.size());
}

void Crowd::place(const std::vector<Pose>& poses, std::size_t first, std::size_t end) {
  constexpr std::size_t batch = 64;
  geometry::PlacedShape placed[batch];
  for (std::size_t begin = first; begin < end; begin += batch) {
    const std::size_t count = std::min(batch, end - begin);
    for (std::size_t i = 0; i < count; ++i) {
      narrow_phase::Body& body = bodies_[begin + i];
      body.pose = poses[begin + i];
      placed[i] = {&body.pose, body.shape};
    }
    world_.shapes->bounds({placed, count}, world_.space, &bounds_[begin]);
  }
}

void PairTester::test(std::span<const narrow_phase::Body> bodies, std::span<const geometry::CandidatePair> pairs) {
  for (const narrow_phase::PairContact& found : narrow_.test(bodies, pairs)) {
    const narrow_phase::Body& a = bodies[pairs[found.pair].a];
    const narrow_phase::Body& b = bodies[pairs[found.pair].b];
    Contact& contact = found_.add();
    contact.a = a.number;
    contact.b = b.number;
    contact.depth = found.depth;
    contact.normal = found.normal;
    contact.point = {a.pose.position.x + static_cast<double>(found.point.x),
                     a.pose.position.y + static_cast<double>(found.point.y),
                     a.pose.position.z + static_cast<double>(found.point.z)};
    contact.arm_a = to_float(contact.point - a.pose.position);
    contact.arm_b = to_float(contact.point - b.pose.position);
  }
}

}  // namespace ringfence::bench
