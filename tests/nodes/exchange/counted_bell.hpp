#pragma once

#include <chrono>

#include "link/doorbell.hpp"

namespace ringfence::nodes::test {

/// A doorbell that says whether it was rung: then a wait that is already over tests its condition once more.
class CountedBell {
 public:
  CountedBell() { tests_without_ring_ = tests(); }
  link::Doorbell& bell() { return bell_; }
  /// Since the last call.
  bool was_rung() { return tests() > tests_without_ring_; }

 private:
  int tests() {
    int tests = 0;
    const auto count = [&] { return ++tests > 100; };
    (void)bell_.wait_until(count, std::chrono::steady_clock::now());
    return tests;
  }

  link::Doorbell bell_{link::SpinPolicy{.yield_polls = 1, .poll_only_after_ring = true}};
  int tests_without_ring_ = 0;
};

}  // namespace ringfence::nodes::test
