#include "facade/users/user_nodes.hpp"

#include <algorithm>
#include <exception>
#include <string>
#include <utility>

namespace ringfence::facade {

using nodes::Request;

const User* UserNodes::find(UserNumber number) const noexcept {
  const auto at = nodes_.find(number);
  return at == nodes_.end() ? nullptr : at->second.get();
}

// Precondition: no frame is running, so roles are idle and publications are not read.
void UserNodes::apply_requests() {
  bool changed = false;
  for (Request& request : state_.order.requests) {
    if (request.kind == Request::Kind::connect) {
      connect(request);
    } else if (request.kind == Request::Kind::disconnect) {
      nodes_.at(request.user)->leaving = true;
    } else {
      continue;
    }
    changed = true;
  }
  if (changed) {
    assign_roles();
  }
}

void UserNodes::connect(Request& request) {
  const UserNumber number = request.user;
  std::unique_ptr<User> user = make_user(number);
  request.connection = threads_.connection(user->thread);
  nodes_[number] = std::move(user);
}

std::unique_ptr<User> UserNodes::make_user(UserNumber number) {
  const WorldConfig& config = state_.config;
  nodes::UserSetup setup;
  setup.user = number;
  setup.model = config.motion.get();
  setup.sense = config.sense;
  setup.objects = config.deployment == Deployment::user ? 64 : 4;
  setup.faults = state_.threaded() ? &state_.faults : nullptr;
  auto user = std::make_unique<User>(setup);
  user->thread = number % threads_.size();
  return user;
}

// Without threads all user nodes have the same one.
void UserNodes::assign_roles() {
  std::vector<std::vector<nodes::UserRole*>> roles(threads_.size());
  for (const auto& [number, user] : nodes_) {
    if (user->is_stepped()) {
      roles[user->thread].push_back(&user->role);
    }
  }
  for (std::size_t thread = 0; thread < threads_.size(); ++thread) {
    threads_.assign(thread, std::move(roles[thread]));
  }
}

void UserNodes::steer(UserOrders& orders) {
  for (const UserOrders::Move& move : orders.moves) {
    if (move.number != 0) {
      nodes_.at(move.user)->role.steer(move.number, move.pose);
    }
  }
  orders.moves.clear();
  for (const UserOrders::Input& input : orders.inputs) {
    nodes_.at(input.user)->role.give_input(input.input);
  }
  orders.inputs.clear();
}

void UserNodes::replace_stalled_threads() {
  nodes::FrameOrder& order = state_.order;
  if (order.users_moved.load(std::memory_order_acquire)) {
    return;  // the server has not read the last lists yet
  }
  const std::vector<std::size_t> stalled = threads_.find_stalled();
  if (stalled.empty()) {
    return;
  }
  order.stalled_users.clear();
  order.moved_connections.clear();
  for (const std::size_t thread : stalled) {
    abandon(thread);
  }
  if (!order.stalled_users.empty()) {
    // Pairs with the server's acquire load: both lists are complete.
    order.users_moved.store(true, std::memory_order_release);
    state_.server_bell()->ring();
  }
}

// The stalled thread keeps the user node in whose move it is. A new thread steps its other user nodes.
void UserNodes::abandon(std::size_t thread) {
  std::unique_ptr<UserThread> replacement;
  try {
    replacement = threads_.start_replacement();
  } catch (const std::exception& error) {
    state_.log.write(LogLevel::error, std::string("no thread can be created to replace a stalled one (") +
                                          error.what() + "): the frame waits for a user node to move");
    return;
  }
  UserThread& stalled = threads_.at(thread);
  if (!stalled.watch.abandon(stalled.seen)) {
    return;  // the move has ended
  }
  stalled.worker->dismiss();
  const UserNumber late = nodes::MoveWatch::user_of(stalled.seen);
  User& user = *nodes_.at(late);
  user.late = true;
  state_.order.stalled_users.push_back(late);
  std::vector<nodes::UserRole*> roles;
  for (const auto& [number, other] : nodes_) {
    if (other->thread == thread && other->is_stepped()) {
      roles.push_back(&other->role);
    }
  }
  state_.order.moved_connections.push_back({threads_.connection(thread), &replacement->worker->bell()});
  user.abandoned = threads_.replace(thread, std::move(replacement), std::move(roles));
}

void UserNodes::forget(std::span<const UserNumber> users) {
  for (const UserNumber number : users) {
    const auto at = nodes_.find(number);
    if (at->second->abandoned != nullptr) {
      stalled_.push_back(std::move(at->second));
    }
    nodes_.erase(at);
  }
}

void UserNodes::free_stalled() {
  std::erase_if(stalled_, [](const auto& user) { return user->abandoned->worker->has_ended(); });
}

bool UserNodes::has_stalled() const noexcept {
  return !stalled_.empty() || std::any_of(nodes_.begin(), nodes_.end(),
                                          [](const auto& entry) { return entry.second->abandoned != nullptr; });
}

// The thread must not step the role meanwhile.
bool UserNodes::inject(const Fault& fault) {
  const auto at = nodes_.find(fault.user.number());
  if (at == nodes_.end() || at->second->late ||
      (fault.stage != NodeStage::model && fault.stage != NodeStage::publication)) {
    return false;
  }
  User& user = *at->second;
  threads_.withdraw(user.thread);
  user.role.fail(fault);
  assign_roles();
  return true;
}

}  // namespace ringfence::facade
