#include "facade/threads/inline_roles.hpp"

#include <atomic>
#include <cstdint>
#include <new>
#include <string>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

/// Writes its name at each step, and completes the frame in its last one.
struct Writer {
  nodes::Step step() {
    written += name;
    if (--steps == 0) completed = 7;
    return nodes::Step::progressed;
  }
  char name;
  std::string& written;
  std::atomic<std::uint64_t>& completed;
  int steps = 1000;
};

TEST_CASE("roles are stepped in turn, those of the server first, until the frame is complete") {
  std::string written;
  std::atomic<std::uint64_t> completed{6};
  Writer server{'s', written, completed}, node{'n', written, completed}, user{'u', written, completed};
  server.steps = 3;
  InlineRoles roles;
  roles.assign_users({Steppable::of(user)});
  roles.assign_server({Steppable::of(server), Steppable::of(node)});
  CHECK(roles.step_until(completed, 7));
  CHECK(written == "snusnusnu");
  CHECK(roles.step_until(completed, 7));
  CHECK(written.size() == 9);
}

TEST_CASE("a role that runs out of memory ends the steps at once") {
  struct Greedy {
    nodes::Step step() { throw std::bad_alloc(); }
  } greedy;
  std::string written;
  std::atomic<std::uint64_t> completed{6};
  Writer first{'s', written, completed}, last{'u', written, completed};
  InlineRoles roles;
  roles.assign_server({Steppable::of(first), Steppable::of(greedy)});
  roles.assign_users({Steppable::of(last)});
  CHECK(!roles.step_until(completed, 7));
  CHECK(written == "s");
}

}  // namespace
}  // namespace ringfence::facade
