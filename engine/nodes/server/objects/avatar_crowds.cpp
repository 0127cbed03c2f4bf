#include "nodes/server/objects/avatar_crowds.hpp"

#include <algorithm>

#include "broad_phase/crowds.hpp"

namespace ringfence::nodes {

void AvatarCrowds::note(UserNumber user) {
  if (avatars_[user].size() >= colliding_ && (changed_.empty() || changed_.back() != user)) {
    changed_.push_back(user);
  }
}

void AvatarCrowds::add(UserNumber user, ObjectNumber avatar) {
  if (colliding_ == 0) {
    return;
  }
  avatars_.resize(std::max<std::size_t>(avatars_.size(), std::size_t{user} + 1));
  avatars_[user].push_back(avatar);
  note(user);
}

void AvatarCrowds::remove(UserNumber user, ObjectNumber avatar) {
  if (colliding_ == 0) {
    return;
  }
  std::vector<ObjectNumber>& avatars = avatars_[user];
  const auto at = std::find(avatars.rbegin(), avatars.rend(), avatar);
  *at = avatars.back();
  avatars.pop_back();
  note(user);
}

void AvatarCrowds::settle(ObjectTable& objects) {
  std::sort(changed_.begin(), changed_.end());
  changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
  for (const UserNumber user : changed_) {
    std::vector<ObjectNumber>& avatars = avatars_[user];
    std::sort(avatars.begin(), avatars.end());
    for (std::size_t i = 0; i < avatars.size(); ++i) {
      const std::uint32_t limited = (user + 1) | (i < colliding_ ? 0 : broad_phase::excess_bit);
      const std::uint32_t crowd = avatars.size() > colliding_ ? limited : 0;
      const std::uint32_t slot = objects.find(avatars[i]);
      if (objects.crowd(slot) != crowd) {
        objects.set_crowd(slot, crowd);
        objects.mark_moved(slot);
      }
    }
  }
  changed_.clear();
}

}  // namespace ringfence::nodes
