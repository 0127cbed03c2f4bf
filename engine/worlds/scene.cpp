#include "worlds/scene.hpp"

#include <algorithm>

namespace ringfence::worlds {

UserNumber users_of(const Scene& scene) {
  UserNumber users = 0;
  for (const ObjectSpec& object : scene.objects) {
    if (object.category == Category::avatar) users = std::max(users, object.user + 1);
  }
  return users;
}

}  // namespace ringfence::worlds
