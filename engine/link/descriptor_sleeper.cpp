#include "link/descriptor_sleeper.hpp"

#include <algorithm>

#include <poll.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

namespace ringfence::link {

DescriptorSleeper::~DescriptorSleeper() {
  if (rings_ >= 0) {
    ::close(rings_);
  }
}

bool DescriptorSleeper::prepare() noexcept {
  rings_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  return rings_ >= 0;
}

void DescriptorSleeper::sleep(const std::atomic<std::uint32_t>& word, std::uint32_t expected) const noexcept {
  if (rings_ < 0) {
    ThreadAtomics::sleep(word, expected);
  } else {
    poll(std::chrono::nanoseconds(-1));
  }
}

void DescriptorSleeper::sleep_until(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                                    std::chrono::steady_clock::time_point deadline) const noexcept {
  if (rings_ < 0) {
    ThreadAtomics::sleep_until(word, expected, deadline);
  } else {
    poll(std::max(deadline - std::chrono::steady_clock::now(), std::chrono::nanoseconds(0)));
  }
}

// The eventfd counts the rings since the last sleep, so a ring before the sleep ends it at once. The futex word needs
// no test here.
void DescriptorSleeper::wake(const std::atomic<std::uint32_t>& word) const noexcept {
  if (rings_ < 0) {
    ThreadAtomics::wake(word);
  } else {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(rings_, &one, sizeof one);
  }
}

// A negative timeout is none. poll() ignores a negative descriptor.
void DescriptorSleeper::poll(std::chrono::nanoseconds timeout) const noexcept {
  pollfd descriptors[2] = {{rings_, POLLIN, 0}, {watched_, POLLIN, 0}};
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(timeout);
  const timespec most{seconds.count(), (timeout - seconds).count()};
  if (::ppoll(descriptors, 2, timeout.count() < 0 ? nullptr : &most, nullptr) > 0 && descriptors[0].revents != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t read = ::read(rings_, &count, sizeof count);
  }
}

}  // namespace ringfence::link
