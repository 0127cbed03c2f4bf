#include "facade/users/user_threads.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::facade {

using telemetry::StepClock;
using telemetry::to_ms;

namespace {

// Large rings save wake-ups. Of many threads each has fewer user nodes, and memory counts.
std::size_t ring_of(std::size_t threads) noexcept {
  constexpr std::size_t few_threads = 16, most = std::size_t{1} << 20, least = std::size_t{1} << 16;
  return std::max(least, most / std::bit_ceil((threads + few_threads - 1) / few_threads));
}

}  // namespace

void UserThreads::start() {
  const std::size_t count = state_.threaded() ? state_.config.user_threads : 1;
  while (threads_.size() < count) {
    threads_.push_back(start_thread());
  }
  channels_.resize(count);
}

std::unique_ptr<UserThread> UserThreads::start_thread() {
  auto thread = std::make_unique<UserThread>(state_.publications, state_.config.interest);
  if (state_.threaded()) {
    thread->worker = std::make_unique<Worker>();
    state_.starter.must_start(*thread->worker);
  }
  return thread;
}

link::Doorbell* UserThreads::bell(std::size_t index) const noexcept {
  Worker* worker = threads_[index]->worker.get();
  return worker != nullptr ? &worker->bell() : nullptr;
}

nodes::UserThreadParts UserThreads::parts_of(UserThread& thread) const noexcept {
  const bool threaded = state_.threaded();
  return {&thread.reader, state_.config.timeline ? &thread.track : nullptr, threaded ? &thread.clock : nullptr,
          threaded && state_.config.deadlines.user_ms > 0 ? &thread.watch : nullptr};
}

DuplexChannel& UserThreads::channel(std::size_t index) {
  std::unique_ptr<DuplexChannel>& channel = channels_[index];
  if (channel == nullptr) {
    channel =
        std::make_unique<DuplexChannel>(state_.ring_bytes(ring_of(threads_.size())), state_.server_bell(), bell(index));
    channel->publication = std::make_unique<nodes::HostPublication>(0, state_.config.interest, state_.kept_frames());
  }
  return *channel;
}

void UserThreads::assign(std::size_t index, std::vector<nodes::UserRole*> users) {
  if (users.empty()) {
    return withdraw(index);
  }
  nodes::UserThreadSetup setup;
  setup.server = channel(index).second();
  setup.publications = &state_.publications;
  setup.parts = parts_of(*threads_[index]);
  setup.first_frame = state_.order.ordered.load(std::memory_order_relaxed);
  assign_role(index, std::make_unique<nodes::UserThreadRole>(setup, std::move(users)));
}

// The old role is destroyed when the thread has the new one.
void UserThreads::assign_role(std::size_t index, std::unique_ptr<nodes::UserThreadRole> role) {
  UserThread& thread = *threads_[index];
  std::vector<Steppable> steppables;
  if (role != nullptr) {
    steppables.push_back(Steppable::of(*role));
  }
  if (state_.threaded()) {
    thread.worker->assign(std::move(steppables));
  } else {
    state_.inline_roles.assign_users(std::move(steppables));
  }
  thread.role = std::move(role);
}

std::vector<std::size_t> UserThreads::find_stalled() {
  std::vector<std::size_t> stalled;
  const std::uint64_t now = telemetry::now_ns();
  const auto apart_ns = static_cast<std::uint64_t>(state_.config.deadlines.user_ms * 0.25e6);  // allows for jitter
  if (now - checked_ns_ < apart_ns) {
    return stalled;
  }
  checked_ns_ = now;
  for (std::size_t index = 0; index < threads_.size(); ++index) {
    const nodes::MoveWatch::Move move = threads_[index]->watch.current();
    if (move == std::exchange(threads_[index]->seen, move) && move != nodes::MoveWatch::none) {
      stalled.push_back(index);
    }
  }
  return stalled;
}

std::unique_ptr<UserThread> UserThreads::replace(std::size_t index, std::unique_ptr<UserThread> replacement,
                                                 std::vector<nodes::UserRole*> users) {
  std::unique_ptr<UserThread> stalled = std::exchange(threads_[index], std::move(replacement));
  if (!users.empty()) {
    assign_role(index,
                std::make_unique<nodes::UserThreadRole>(*stalled->role, parts_of(*threads_[index]), std::move(users)));
  }
  return stalled;
}

void UserThreads::report_times(FrameReport& report) {
  report.users_cpu_ms = report.slowest_user_cpu_ms = 0;
  if (!state_.threaded()) {
    report.path = {};
    return;
  }
  PathReport& path = report.path;
  for (const auto& thread : threads_) {
    // A wait that had not ended at the end of the last frame counted then, and may be longer than all of this frame.
    const std::uint64_t cpu_ns = std::max(thread->worker->working_cpu_ns(), thread->cpu_ns);
    const std::uint64_t all_ns = cpu_ns - std::exchange(thread->cpu_ns, cpu_ns);
    const std::uint64_t move_ns = std::min(all_ns, thread->clock.take(StepClock::move));
    const std::uint64_t read_ns = std::min(all_ns - move_ns, thread->clock.take(StepClock::read_publications));
    report.users_cpu_ms += to_ms(all_ns);
    report.slowest_user_cpu_ms = std::max(report.slowest_user_cpu_ms, to_ms(all_ns));
    path.user_move_ms = std::max(path.user_move_ms, to_ms(move_ns));
    path.user_read_ms = std::max(path.user_read_ms, to_ms(read_ns));
    path.user_end_ms = std::max(path.user_end_ms, to_ms(all_ns - move_ns - read_ns));
  }
}

}  // namespace ringfence::facade
