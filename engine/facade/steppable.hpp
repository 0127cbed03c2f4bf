#pragma once

#include "nodes/role.hpp"

namespace ringfence::facade {

/// Type-erased role for a thread: something to step.
struct Steppable {
  void* role = nullptr;
  nodes::Step (*step)(void*) = nullptr;

  template <class Role>
  static Steppable of(Role& role) noexcept {
    return {&role, [](void* self) { return static_cast<Role*>(self)->step(); }};
  }
};

}  // namespace ringfence::facade
