#include "worlds/scene.hpp"

#include <algorithm>

namespace ringfence::worlds {

std::uint32_t users_of(const Scene& scene) {
  std::uint32_t users = 0;
  for (const ObjectSpec& object : scene.objects) {
    if (object.category == Category::avatar) users = std::max(users, object.user.number() + 1);
  }
  return users;
}

}  // namespace ringfence::worlds
