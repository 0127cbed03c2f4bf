#include "link/watchdog.hpp"

#include <cstdio>
#include <cstdlib>
#include <utility>

namespace ringfence::link {

Watchdog::Watchdog(std::string test, std::chrono::milliseconds patience)
    : test_(std::move(test)), patience_(patience), thread_([this] { watch(); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Post& Watchdog::post(std::string name) {
  const std::lock_guard lock(mutex_);
  return posts_.emplace_back(std::move(name));
}

void Watchdog::watch() {
  std::unique_lock lock(mutex_);
  std::uint64_t seen = moves();
  while (!changed_.wait_for(lock, patience_, [&] { return over_; })) {
    const std::uint64_t now = moves();
    if (now == seen) {
      std::fputs(report().c_str(), stderr);
      std::fflush(stderr);
      std::_Exit(1);
    }
    seen = now;
  }
}

std::uint64_t Watchdog::moves() {
  std::uint64_t sum = 0;
  for (const Post& post : posts_) sum += post.moves_.load(std::memory_order_relaxed);
  return sum;
}

std::string Watchdog::report() {
  std::string text =
      "\"" + test_ + "\" hangs: nobody has got anywhere for " + std::to_string(patience_.count()) + " ms\n";
  for (const Post& post : posts_) {
    const char* what = post.waits_for_.load(std::memory_order_relaxed);
    text += "  " + post.name_;
    if (post.left_.load(std::memory_order_relaxed)) {
      text += " is done";
    } else if (what) {
      text += std::string(" waits for ") + what;
    } else {
      text += " runs";
    }
    text += ", after " + std::to_string(post.moves_.load(std::memory_order_relaxed)) + " steps\n";
  }
  return text;
}

}  // namespace ringfence::link
