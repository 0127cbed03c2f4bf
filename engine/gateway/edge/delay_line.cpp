#include "gateway/edge/delay_line.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::gateway {
namespace {

std::uint64_t key_of(ConnectionId connection, bool is_incoming) noexcept {
  return connection * 2 + (is_incoming ? 1 : 0);
}

}  // namespace

DelayLine::DelayLine(net::io_context& io, const NetworkModel& model, Deliver deliver)
    : model_(model), deliver_(std::move(deliver)), timer_(io.get_executor()), random_(model.seed) {}

bool DelayLine::applies_to(ConnectionId connection, const std::string& address) const noexcept {
  if (model_.is_perfect()) return false;
  if (!model_.address.empty() && model_.address != address) return false;
  // The same share of every 100 connections in a row, spread among them.
  return static_cast<double>(connection * 61 % 100) < model_.share * 100;
}

void DelayLine::add(ConnectionId connection, bool is_incoming, bool may_be_lost, Delivery delivery,
                    std::span<const std::byte> bytes) {
  std::uniform_real_distribution<double> uniform(0, 1);
  if (may_be_lost && uniform(random_) < model_.loss) return;
  double due_s = telemetry::now_s() + model_.delay_s + uniform(random_) * model_.jitter_s;
  if (!may_be_lost) {
    double& last = last_due_[key_of(connection, is_incoming)];
    due_s = std::max(due_s, last);
    last = due_s;
  }
  const bool is_next = waiting_.empty() || due_s < waiting_.top().due_s;
  waiting_.push({due_s, ++order_, connection, is_incoming, delivery, {bytes.begin(), bytes.end()}});
  if (is_next) wait();
}

void DelayLine::forget(ConnectionId connection) {
  last_due_.erase(key_of(connection, false));
  last_due_.erase(key_of(connection, true));
}

void DelayLine::wait() {
  const double left_s = std::max(0.0, waiting_.top().due_s - telemetry::now_s());
  timer_.expires_after(std::chrono::nanoseconds(static_cast<std::int64_t>(left_s * 1e9)));
  timer_.async_wait([this](const error_code& error) {
    if (!error) deliver_due();
  });
}

void DelayLine::deliver_due() {
  while (!waiting_.empty() && waiting_.top().due_s <= telemetry::now_s()) {
    Message message = waiting_.top();
    waiting_.pop();
    deliver_(message);
  }
  if (!waiting_.empty()) wait();
}

}  // namespace ringfence::gateway
