#pragma once

#include <cstddef>
#include <cstdint>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence {

/// How an object moves. Together with the deployment it decides which role hosts the object, that is, moves it and
/// responds to its contacts.
enum class Category : std::uint8_t {
  avatar,      ///< under a user's direct control; always hosted by that user node
  active,      ///< moved by programmed logic; hosted by a user node, the server or a CD node
  non_active,  ///< moves only when a contact moves it; hosted like an active object
  fixed,       ///< `static` in files: terrain, walls; never moves, has no host, touches no other static object
};

/// Name of a category in scene files: "avatar", "active", "non-active", "static".
constexpr const char* name_of(Category category) noexcept {
  constexpr const char* names[] = {"avatar", "active", "non-active", "static"};
  return names[static_cast<std::size_t>(category)];
}

/// Description of an object at its spawn.
struct ObjectSpec {
  ObjectNumber number = 0;  ///< 0: the next free number is assigned
  ShapeId shape;
  Category category = Category::active;
  std::uint8_t layer = 0;  ///< index into WorldConfig::layers
  /// Objects of one group do not collide with each other, such as the parts of a vehicle; 0: no group.
  std::uint32_t group = 0;
  bool enabled = true;    ///< false: in no contact, and no user node sees it until World::set_enabled, place or move
  UserId user = no_user;  ///< the hosting user node: required for avatars, no_user for all others
  std::uint64_t user_data = 0;
  Pose pose{};
};

}  // namespace ringfence
