#pragma once

#include <cstddef>
#include <memory>

#include "link/channel.hpp"
#include "nodes/findings.hpp"
#include "nodes/publications.hpp"
#include "nodes/role.hpp"

namespace ringfence::facade {

/// The way between two roles: one channel each way; between the server and a CD node in this process also memory that
/// they share.
struct Way {
  Way(std::size_t bytes, link::Doorbell* first, link::Doorbell* second)
      : forth(bytes, second, first), back(bytes, first, second) {}
  nodes::Line first() noexcept { return {&forth.sender(), &back.receiver(), findings.get(), publication.get()}; }
  nodes::Line second() noexcept { return {&back.sender(), &forth.receiver(), findings.get(), publication.get()}; }
  link::Channel forth;
  link::Channel back;
  std::unique_ptr<nodes::Findings> findings;
  std::unique_ptr<nodes::NodePublication> publication;
};

}  // namespace ringfence::facade
