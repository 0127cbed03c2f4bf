#include "gateway/client/obstacles.hpp"

#include <algorithm>
#include <utility>

#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

/// A contact of an avatar and another object. `normal`: from the object with the lower number.
Contact contact_of(ObjectNumber avatar, ObjectNumber other, std::uint64_t user_data, const Vec3f& normal, float depth,
                   const Vec3d& point) {
  Contact contact;
  contact.phase = Phase::persist;
  contact.a = std::min(avatar, other);
  contact.b = std::max(avatar, other);
  contact.normal = normal;
  contact.depth = depth;
  contact.point = point;
  (avatar < other ? contact.user_data_b : contact.user_data_a) = user_data;
  return contact;
}

Vec3f reversed(const Vec3f& v) noexcept { return {-v.x, -v.y, -v.z}; }

}  // namespace

void Obstacles::add(ShapeId shape, const ShapeDescription& description) {
  try {
    shapes_.try_emplace(shape, description);
  } catch (const Error&) {
    // Without it, the avatar is predicted to walk through objects of this shape until the server says otherwise.
  }
}

void Obstacles::select(const Replica& replica, const Vec3d& centre, double reach) {
  selected_.clear();
  for (const auto& [number, object] : replica.objects()) {
    if (object.category != Category::fixed && object.category != Category::non_active) continue;
    const Vec3d position = position_of(object.position);
    const auto found = shapes_.find(object.shape);
    if (found == shapes_.end()) continue;
    const double x = position.x - centre.x, y = position.y - centre.y, z = position.z - centre.z;
    const double limit = reach + found->second.bounding_radius();
    if (x * x + y * y + z * z > limit * limit) continue;
    selected_.push_back({number, &found->second, {position, orientation_of(object.turn)}, user_data_of_(object)});
  }
  std::ranges::sort(selected_, {}, &Obstacle::number);
}

void Obstacles::find(ObjectNumber avatar, ShapeId shape, const Pose& pose, std::vector<Contact>& contacts) const {
  contacts.clear();
  const auto own = shapes_.find(shape);
  if (own == shapes_.end()) return;
  for (const Obstacle& other : selected_) {
    const bool is_first = avatar < other.number;
    const CollideResult result = is_first ? collide(own->second, pose, *other.shape, other.pose)
                                          : collide(*other.shape, other.pose, own->second, pose);
    if (!result.contact) continue;
    const auto& [normal, depth, point] = *result.contact;
    contacts.push_back(contact_of(avatar, other.number, other.user_data, normal, depth, point));
  }
}

void Obstacles::read(const Replica& replica, ObjectNumber avatar, std::vector<Contact>& contacts) const {
  contacts.clear();
  for (const OwnContact& own : replica.contacts()) {
    const auto found = replica.objects().find(own.other);
    if (own.phase == Phase::end || found == replica.objects().end()) continue;
    const Vec3f to_other = normal_of(own.normal);
    contacts.push_back(
        contact_of(avatar, own.other, user_data_of_(found->second), avatar < own.other ? to_other : reversed(to_other),
                   static_cast<float>(static_cast<double>(own.depth) * quantum), position_of(own.point)));
  }
}

}  // namespace ringfence::gateway
