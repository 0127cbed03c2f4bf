#include "nodes/user/user_thread_role.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

UserThreadRole::UserThreadRole(const Connection& server, std::vector<UserRole*> users, std::uint64_t first_frame)
    : server_(server),
      users_(std::move(users)),
      first_frame_(first_frame),
      state_bytes_(users_.empty() ? 0 : users_.front()->state_bytes()),
      next_(users_.size()) {}

UserThreadRole::UserThreadRole(const UserThreadRole& stalled, std::vector<UserRole*> users)
    : UserThreadRole(stalled.server_, std::move(users), stalled.first_frame_) {
  to_all_ = stalled.to_all_;
  frame_ = stalled.frame_;
  if (stalled.next_ < stalled.users_.size()) {
    next_ = position_of(stalled.users_[stalled.next_]->number());
  }
}

Step UserThreadRole::step() {
  // The server works and sends meanwhile.
  constexpr std::size_t messages_a_ring = 16;
  const auto before = std::pair(next_, blocked_);
  std::size_t received = 0;
  server_.out->set_quiet(true);
  Step step = resume();
  while (step == Step::idle) {
    const std::span<const std::byte> bytes = server_.in->next();
    if (bytes.empty()) {
      break;
    }
    step = receive(bytes);
    if (step != Step::abandoned && ++received % messages_a_ring == 0) {
      server_.in->release();
      server_.out->ring_unrung();
    }
  }
  if (step == Step::abandoned) [[unlikely]] {
    return step;
  }
  server_.in->release();
  server_.out->ring_unrung();
  return received != 0 || before != std::pair(next_, blocked_) ? Step::progressed : step;
}

Step UserThreadRole::receive(std::span<const std::byte> bytes) {
  MessageView message;
  if (messages::decode(bytes, state_bytes_, message) != Status::ok || message.header().frame < first_frame_) {
    return Step::idle;
  }
  const Endpoint destination{message.header().destination};
  if (destination == Endpoint::all_users()) {
    to_all_ = message.type();
    frame_ = message.header().frame;
    next_ = 0;
    return pass_to_all();
  }
  UserRole* const user = find(destination.number());
  const Step step = user != nullptr ? user->receive(message) : Step::idle;
  blocked_ = step == Step::blocked ? user : nullptr;
  return step;
}

Step UserThreadRole::resume() {
  if (blocked_ != nullptr) {
    if (const Step step = blocked_->resume(); step != Step::idle) {
      return step;
    }
    blocked_ = nullptr;
  }
  return pass_to_all();
}

Step UserThreadRole::pass_to_all() {
  constexpr std::size_t users_a_ring = 16;
  const bool begins = to_all_ == MessageType::frame_begin;
  while (next_ < users_.size()) {
    prefetch_next(begins);
    UserRole* const user = users_[next_++];
    const Step step = begins ? user->begin(frame_) : user->allow_reading();
    if (step != Step::idle) {
      blocked_ = step == Step::blocked ? user : nullptr;
      return step;
    }
    if (next_ % users_a_ring == 0) {
      server_.out->ring_unrung();
    }
  }
  return Step::idle;
}

// Of many user nodes none is in a cache. First the lines of the object, then those that its pointers refer to.
void UserThreadRole::prefetch_next(bool begins) const noexcept {
  constexpr std::size_t ahead = 2;
  if (next_ + 3 * ahead < users_.size()) {
    users_[next_ + 3 * ahead]->prefetch(begins);
    users_[next_ + 2 * ahead]->prefetch_arrays(begins);
    if (begins) {
      users_[next_ + ahead]->prefetch_publication();
    }
  }
}

std::size_t UserThreadRole::position_of(UserNumber number) const noexcept {
  const auto is_before = [](const UserRole* user, UserNumber wanted) { return user->number() < wanted; };
  return static_cast<std::size_t>(std::lower_bound(users_.begin(), users_.end(), number, is_before) - users_.begin());
}

// The server sends to the user nodes in the order of their numbers.
UserRole* UserThreadRole::find(UserNumber number) noexcept {
  if (guess_ >= users_.size() || users_[guess_]->number() != number) {
    guess_ = position_of(number);
  }
  if (guess_ == users_.size() || users_[guess_]->number() != number) {
    return nullptr;
  }
  constexpr std::size_t ahead = 8;
  if (guess_ + ahead < users_.size()) {
    users_[guess_ + ahead]->prefetch(false);
  }
  return users_[guess_++];
}

}  // namespace ringfence::nodes
