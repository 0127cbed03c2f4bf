#include "facade/requests/user_numbers.hpp"

#include <algorithm>

namespace ringfence::facade {

bool UserNumbers::is_connected(UserNumber user) const noexcept {
  return std::binary_search(connected_.begin(), connected_.end(), user);
}

bool UserNumbers::in_use(UserNumber user) const noexcept {
  const auto holds = [&](const std::vector<UserNumber>& list) {
    return std::find(list.begin(), list.end(), user) != list.end();
  };
  return is_connected(user) || holds(leaving_) || holds(cut_leaving_);
}

UserNumber UserNumbers::free_number() const noexcept {
  UserNumber user = 0;
  while (in_use(user)) {
    ++user;
  }
  return user;
}

void UserNumbers::connect(UserNumber user) {
  connected_.insert(std::lower_bound(connected_.begin(), connected_.end(), user), user);
}

void UserNumbers::disconnect(UserNumber user) {
  connected_.erase(std::lower_bound(connected_.begin(), connected_.end(), user));
  leaving_.push_back(user);
}

}  // namespace ringfence::facade
