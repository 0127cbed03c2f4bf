#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "gateway/client/replica.hpp"
#include "ringfence/collide.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::gateway {

/// Finds the contacts of a predicted avatar with the objects near it that do not move by themselves: static and
/// non-active ones. The positions of others are quantised, so depths differ from those of the server by about 2 mm.
class Obstacles {
 public:
  /// What the model reads as ObjectSpec::user_data of another object; updates do not have it.
  using UserDataOf = std::function<std::uint64_t(const Replica::Object&)>;
  explicit Obstacles(UserDataOf user_data_of) : user_data_of_(std::move(user_data_of)) {}

  /// A shape that the gateway described; one that cannot be prepared is ignored.
  void add(ShapeId shape, const ShapeDescription& description);
  bool has(ShapeId shape) const { return shapes_.contains(shape); }

  /// Selects the objects that may have a point within `reach` metres of a position.
  void select(const Replica& replica, const Vec3d& centre, double reach);
  /// The contacts of an avatar with the selected objects, in ascending order of their numbers.
  void find(ObjectNumber avatar, ShapeId shape, const Pose& pose, std::vector<Contact>& contacts) const;
  /// The contacts that an update reports, with all objects that the replica has.
  void read(const Replica& replica, ObjectNumber avatar, std::vector<Contact>& contacts) const;

 private:
  struct Obstacle {
    ObjectNumber number = 0;
    const PreparedShape* shape = nullptr;
    Pose pose;
    std::uint64_t user_data = 0;
  };

  UserDataOf user_data_of_;
  std::unordered_map<ShapeId, PreparedShape> shapes_;
  std::vector<Obstacle> selected_;
};

}  // namespace ringfence::gateway
