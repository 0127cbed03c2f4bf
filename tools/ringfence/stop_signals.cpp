#include "stop_signals.hpp"

#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>

namespace ringfence::tools {
namespace {

constexpr std::array caught{SIGINT, SIGTERM};

// Any thread of the process may run the handler.
std::atomic<int> first_signal{0};
static_assert(std::atomic<int>::is_always_lock_free);
std::array<struct sigaction, caught.size()> previous;

void note(int signal) {
  int none = 0;
  if (first_signal.compare_exchange_strong(none, signal)) return;
  std::signal(signal, SIG_DFL);
  raise(signal);
}

}  // namespace

StopSignals::StopSignals() {
  first_signal = 0;
  struct sigaction action {};
  action.sa_handler = note;
  action.sa_flags = SA_RESTART;
  for (std::size_t i = 0; i < caught.size(); ++i) sigaction(caught[i], &action, &previous[i]);
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < caught.size(); ++i) sigaction(caught[i], &previous[i], nullptr);
}

const char* StopSignals::received() const noexcept {
  switch (first_signal.load()) {
    case SIGINT:
      return "SIGINT";
    case SIGTERM:
      return "SIGTERM";
    default:
      return nullptr;
  }
}

}  // namespace ringfence::tools
