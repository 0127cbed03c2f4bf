#include "facade/own_kernels.hpp"

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
  for (std::size_t i = first; i < end; ++i) {
    bodies_[i].pose = poses[i];
    bounds_[i] = world_.shapes->bounds(bodies_[i].shape, poses[i], world_.space);
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
