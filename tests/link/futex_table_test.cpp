#include "link/futex_table.hpp"

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <sys/prctl.h>

#include "link/doorbell.hpp"

namespace ringfence::link {
namespace {

/// What the kernel says; negative if it has no table for each process.
int slots() { return prctl(78, 2ul, 0ul, 0ul, 0ul); }

/// Threads that sleep on their doorbells until all are released.
class Sleepers {
 public:
  explicit Sleepers(std::size_t count) : bells_(count) {
    for (Doorbell& bell : bells_) {
      threads_.emplace_back([this, &bell] {
        ++started_;
        bell.wait([this] { return released_.load(); });
      });
    }
    while (started_ < count) {
      std::this_thread::yield();
    }
  }
  void release() {
    released_ = true;
    for (Doorbell& bell : bells_) {
      bell.ring();
    }
    for (std::thread& thread : threads_) {
      thread.join();
    }
  }

 private:
  std::vector<Doorbell> bells_;
  std::vector<std::thread> threads_;
  std::atomic<std::size_t> started_{0};
  std::atomic<bool> released_{false};
};

TEST_CASE("the table of sleeping threads grows with them, and all are woken") {
  Sleepers before(40);
  const int default_slots = slots();
  reserve_futex_slots(32);
  CHECK(slots() == default_slots);
  reserve_futex_slots(1000);
  Sleepers after(8);
  if (default_slots >= 0) {
    CHECK(slots() >= 500);
    const int grown = slots();
    reserve_futex_slots(40);
    CHECK(slots() == grown);
  } else {
    MESSAGE("this kernel has one table for all processes");
  }
  before.release();
  after.release();
}

}  // namespace
}  // namespace ringfence::link
