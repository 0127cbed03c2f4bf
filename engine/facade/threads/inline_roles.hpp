#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "facade/threads/steppable.hpp"

namespace ringfence::facade {

/// The roles of a World with nodes = 0, which the thread that calls World steps: first those that the server's thread
/// steps otherwise, then those of the user threads.
///
/// Threads: the one that calls World. The roles outlive their use by step_until(). Memory is allocated only by the
/// caller, who makes the lists.
class InlineRoles {
 public:
  /// Replaces the server and the CD nodes.
  void assign_server(std::vector<Steppable> roles) noexcept;
  /// Replaces the user nodes.
  void assign_users(std::vector<Steppable> roles) noexcept;
  /// Steps all roles in turn until `completed` has the value `frame`. Returns false, at once, if a role runs out of
  /// memory. Precondition: the roles complete the frame.
  [[nodiscard]] bool step_until(const std::atomic<std::uint64_t>& completed, std::uint64_t frame) const;

 private:
  std::vector<Steppable> server_;
  std::vector<Steppable> users_;
};

}  // namespace ringfence::facade
