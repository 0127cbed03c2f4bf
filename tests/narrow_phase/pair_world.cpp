#include "narrow_phase/pair_world.hpp"

#include <algorithm>
#include <optional>
#include <sstream>

#include "reference/contact_check.hpp"
#include "reference/separation.hpp"

namespace ringfence::narrow_phase_test {
namespace {

Vec3d along(const Vec3d& from, const Vec3d& direction, double distance) {
  return {from.x + direction.x * distance, from.y + direction.y * distance, from.z + direction.z * distance};
}

double smallest_size(const ShapeDescription& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const auto* box = std::get_if<Box>(&shape)) {
    return std::min({box->half_extents.x, box->half_extents.y, box->half_extents.z});
  }
  return std::get<Capsule>(shape).radius;
}

/// A position of b's origin, for an a at `a`, that is hard for the kernels.
Vec3d special_position(RandomSource& random, const reference::PreparedShape& a, const Pose& pose_a,
                       const reference::PreparedShape& b, const Pose& turned_b, double small) {
  const double sum_of_radii = a.bounding_radius + b.bounding_radius;
  switch (random.below(5)) {
    case 0:
      return pose_a.position;
    case 1:  // almost the same position
      return pose_a.position + random.vector(random.logarithmic(1e-12, 1e-3) * small);
    case 2: {  // offset along one axis of a, by simple fractions of the size
      Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
      const double far = a.bounding_radius * 0.25 * random.below(8);
      return along(pose_a.position, axes[random.below(3)], far);
    }
    case 3:  // anywhere near
      return pose_a.position + random.vector(random.uniform(0, 1) * sum_of_radii);
    default: {  // touching, or nearly touching
      Pose pose_b = turned_b;
      const Vec3d direction = random.direction();
      double low = 0, high = sum_of_radii * 1.01;
      for (int i = 0; i < 40; ++i) {
        const double middle = (low + high) / 2;
        pose_b.position = along(pose_a.position, direction, middle);
        (reference::separation(a, pose_a, b, pose_b).distance > 0 ? high : low) = middle;
      }
      double off = random.below(2) == 0 ? 0 : random.logarithmic(1e-7, 1e-2) * small;
      if (off != 0 && random.below(2) == 0) off = -off;
      return along(pose_a.position, direction, low + off);
    }
  }
}

}  // namespace

PairWorld ordinary_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed, const Vec3d& origin) {
  RandomSource random(seed);
  PairWorld world;
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeDescription a = random.ordinary(p), b = random.ordinary(q);
    const Vec3d place = origin + random.vector(0, 100);
    const std::uint32_t first = world.add(a, {place, random.orientation()});
    const double sum_of_radii = double{world.table->row(world.bodies[first].shape).bounding_radius} + 1.2;
    const std::uint32_t second =
        world.add(b, {place + random.vector(random.uniform(0, 1.1) * sum_of_radii), random.orientation()});
    world.pairs.push_back({first, second});
  }
  return world;
}

PairWorld degenerate_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed, const Vec3d& origin) {
  RandomSource random(seed);
  PairWorld world;
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeDescription a = random.degenerate(p), b = random.degenerate(q);
    const Quat orientation_a = random.below(2) == 0 ? Quat{} : random.orientation();
    const Quat orientation_b = random.below(3) == 0 ? random.orientation() : random.special_orientation(orientation_a);
    const Pose pose_a{origin, orientation_a};
    const std::uint32_t first = world.add(a, pose_a);
    const std::uint32_t second = world.add(b, {origin, orientation_b});
    const auto& bodies = world.bodies;
    world.bodies[second].pose.position =
        special_position(random, world.reference[bodies[first].shape], pose_a, world.reference[bodies[second].shape],
                         bodies[second].pose, std::min(smallest_size(a), smallest_size(b)));
    world.pairs.push_back({first, second});
  }
  return world;
}

CheckResult check_contacts(const PairWorld& world, std::span<const geometry::CandidatePair> pairs,
                           std::span<const narrow_phase::PairContact> contacts, double relative, std::size_t most) {
  std::vector<const narrow_phase::PairContact*> found(pairs.size(), nullptr);
  CheckResult result;
  std::ostringstream text;
  text.precision(9);
  result.contacts = contacts.size();
  for (const narrow_phase::PairContact& contact : contacts) {
    if (contact.pair >= pairs.size() || found[contact.pair] != nullptr) {
      ++result.wrong;
      text << "pair " << contact.pair << " is reported twice or unknown\n";
      continue;
    }
    found[contact.pair] = &contact;
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const narrow_phase::Body &a = world.bodies[pairs[i].a], &b = world.bodies[pairs[i].b];
    std::optional<Contact> claimed;
    if (found[i] != nullptr) {
      claimed.emplace();
      claimed->depth = found[i]->depth;
      claimed->normal = found[i]->normal;
      claimed->point = {a.pose.position.x + double{found[i]->point.x}, a.pose.position.y + double{found[i]->point.y},
                        a.pose.position.z + double{found[i]->point.z}};
    }
    // The results are floats: depth, point and normal cannot be more precise than rounding at the larger size.
    const reference::Tolerance tolerance{.relative = relative, .of_larger = 2e-7};
    const std::string wrong = reference::describe_error(world.reference[a.shape], a.pose, world.reference[b.shape],
                                                        b.pose, claimed ? &*claimed : nullptr, tolerance);
    if (wrong.empty()) continue;
    if (result.wrong++ >= most) continue;
    const auto print = [&](const narrow_phase::Body& body) {
      const geometry::ShapeRow& row = world.table->row(body.shape);
      const Pose& pose = body.pose;
      text << name_of(row.kind) << " {" << row.size[0] << ", " << row.size[1] << ", " << row.size[2] << "} at ("
           << pose.position.x << ", " << pose.position.y << ", " << pose.position.z << ") turned ("
           << pose.orientation.x << ", " << pose.orientation.y << ", " << pose.orientation.z << ", "
           << pose.orientation.w << ")";
    };
    text << "pair " << i << ": " << wrong << "\n  ";
    print(a);
    text << "\n  ";
    print(b);
    text << '\n';
  }
  result.text = text.str();
  return result;
}

}  // namespace ringfence::narrow_phase_test
