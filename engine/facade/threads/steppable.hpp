#pragma once

#include <new>

#include "nodes/role.hpp"

namespace ringfence::facade {

/// A role of any type, as a thread steps it. The role outlives it.
///
/// If an allocation fails in a step, `step` returns nodes::Step::out_of_memory, because nothing may throw in a frame.
struct Steppable {
  void* role = nullptr;
  nodes::Step (*step)(void*) = nullptr;

  template <class Role>
  static Steppable of(Role& role) noexcept {
    return {&role, [](void* self) {
              try {
                return static_cast<Role*>(self)->step();
              } catch (const std::bad_alloc&) {
                return nodes::Step::out_of_memory;
              }
            }};
  }
};

}  // namespace ringfence::facade
