#include "nodes/server/frame/map_planner.hpp"

#include <cassert>
#include <system_error>
#include <utility>

namespace ringfence::nodes {

MapPlanner::~MapPlanner() {
  if (!thread_.joinable()) {
    return;
  }
  state_.wait(ordered, std::memory_order_acquire);
  state_.store(ending, std::memory_order_release);
  state_.notify_all();
  thread_.join();
}

void MapPlanner::start(Order order) {
  assert(!is_started());
  order_ = std::move(order);
  if (!thread_.joinable()) {
    try {
      thread_ = std::thread([this] { run(); });
    } catch (const std::system_error&) {
      return compute();
    }
  }
  state_.store(ordered, std::memory_order_release);
  state_.notify_all();
}

std::span<const std::uint32_t> MapPlanner::take() {
  assert(is_started());
  state_.wait(ordered, std::memory_order_acquire);
  order_.reset();
  if (failure_ != nullptr) {
    std::rethrow_exception(std::exchange(failure_, nullptr));
  }
  return table_;
}

void MapPlanner::run() {
  for (;;) {
    state_.wait(idle, std::memory_order_acquire);
    if (state_.load(std::memory_order_acquire) == ending) {
      return;
    }
    compute();
    state_.store(idle, std::memory_order_release);
    state_.notify_all();
  }
}

void MapPlanner::compute() noexcept {
  table_ = {};
  try {
    balance_.refine(order_->map, static_cast<std::uint32_t>(order_->nodes.size()));
    table_ = balance_.propose(order_->map, order_->nodes, order_->resent);
  } catch (...) {
    failure_ = std::current_exception();
  }
}

}  // namespace ringfence::nodes
