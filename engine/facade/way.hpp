#pragma once

#include <cstddef>

#include "link/channel.hpp"
#include "nodes/role.hpp"

namespace ringfence::facade {

/// The way between two roles: one channel each way.
struct Way {
  Way(std::size_t bytes, link::Doorbell* first, link::Doorbell* second)
      : forth(bytes, second, first), back(bytes, first, second) {}
  nodes::Line first() noexcept { return {&forth.sender(), &back.receiver()}; }
  nodes::Line second() noexcept { return {&back.sender(), &forth.receiver()}; }
  link::Channel forth;
  link::Channel back;
};

}  // namespace ringfence::facade
