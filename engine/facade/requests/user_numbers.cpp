#include "facade/requests/user_numbers.hpp"

#include <algorithm>

namespace ringfence::facade {

UserNumber UserNumbers::free_number() noexcept {
  while (in_use(lowest_)) {
    ++lowest_;
  }
  return lowest_;
}

void UserNumbers::connect(UserNumber user) {
  uses_.resize(std::max<std::size_t>(uses_.size(), std::size_t{user} + 1));
  uses_[user] = Use::connected;
}

void UserNumbers::disconnect(UserNumber user) {
  leaving_.push_back(user);
  uses_[user] = Use::leaving;
}

void UserNumbers::forget_cut() noexcept {
  for (const UserNumber user : cut_leaving_) {
    uses_[user] = Use::none;
    lowest_ = std::min(lowest_, user);
  }
  cut_leaving_.clear();
}

}  // namespace ringfence::facade
