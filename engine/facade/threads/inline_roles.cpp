#include "facade/threads/inline_roles.hpp"

#include <utility>

namespace ringfence::facade {

namespace {

// Returns false if a role has run out of memory.
bool step_all(const std::vector<Steppable>& roles) {
  for (const Steppable& role : roles) {
    if (role.step(role.role) == nodes::Step::out_of_memory) {
      return false;
    }
  }
  return true;
}

}  // namespace

void InlineRoles::assign_server(std::vector<Steppable> roles) noexcept { server_ = std::move(roles); }

void InlineRoles::assign_users(std::vector<Steppable> roles) noexcept { users_ = std::move(roles); }

bool InlineRoles::step_until(const std::atomic<std::uint64_t>& completed, std::uint64_t frame) const {
  while (completed.load(std::memory_order_acquire) != frame) {
    if (!step_all(server_) || !step_all(users_)) {
      return false;
    }
  }
  return true;
}

}  // namespace ringfence::facade
