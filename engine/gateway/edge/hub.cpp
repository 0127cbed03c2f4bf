#include "gateway/edge/hub.hpp"

#include <chrono>
#include <ctime>
#include <utility>
#include <variant>
#include <vector>

#include "gateway/protocol/client_messages.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::gateway {
namespace {

constexpr double closing_limit_s = 2;  // for the other side to answer a close frame

bool may_be_lost(std::span<const std::byte> message) noexcept {
  if (message.empty()) return false;
  const auto type = static_cast<ClientMessageType>(message[0]);
  return type == ClientMessageType::input || type == ClientMessageType::ack;
}

}  // namespace

Hub::Hub(net::io_context& io, const EdgeConfig& config)
    : io_(io),
      config_(config),
      admission_(config.world, config.token_key),
      page_(config.page_directory),
      addresses_(config.limits),
      sweep_timer_(io.get_executor()),
      delays_(io, config.network, [this](DelayLine::Message& message) { deliver_delayed(message); }) {
  start_sweep();
}

void Hub::take(Inbox& inbox) {
  inbox.clear();
  const std::lock_guard lock(mutex_);
  std::swap(inbox, inbox_);
}

void Hub::send(Outbox& outbox) {
  bool posts = false;
  {
    const std::lock_guard lock(mutex_);
    if (outbox_.messages.empty() && outbox_.closes.empty()) {
      std::swap(outbox_, outbox);
    } else {
      // The thread of the edge has not taken the last batch yet.
      const auto base = static_cast<std::uint32_t>(outbox_.bytes.size());
      outbox_.bytes.insert(outbox_.bytes.end(), outbox.bytes.begin(), outbox.bytes.end());
      for (Outbox::Message& message : outbox.messages) message.offset += base;
      outbox_.messages.insert(outbox_.messages.end(), outbox.messages.begin(), outbox.messages.end());
      outbox_.closes.insert(outbox_.closes.end(), outbox.closes.begin(), outbox.closes.end());
    }
    posts = !std::exchange(is_posted_, true);
  }
  outbox.clear();
  if (posts) net::post(io_, [this] { deliver_pending(); });
}

void Hub::deliver_pending() {
  {
    const std::lock_guard lock(mutex_);
    is_posted_ = false;
    delivered_.clear();
    std::swap(delivered_, outbox_);
  }
  deliver(delivered_);
}

void Hub::deliver(Outbox& outbox) {
  for (const Outbox::Message& message : outbox.messages) {
    const auto found = peers_.find(message.connection);
    if (found == peers_.end()) continue;
    const auto bytes = std::span<const std::byte>(outbox.bytes).subspan(message.offset, message.size);
    if (delays_.applies_to(message.connection, found->second->address())) {
      delays_.add(message.connection, false, message.delivery == Delivery::newest, message.delivery, bytes);
    } else {
      found->second->send(message.delivery, bytes);
    }
  }
  for (const Outbox::Close& close : outbox.closes) {
    const auto found = peers_.find(close.connection);
    if (found == peers_.end()) continue;
    const std::shared_ptr<Peer> peer = found->second;  // closing may remove it
    refuse(*peer, close.code, close.reason);
  }
}

void Hub::deliver_delayed(DelayLine::Message& message) {
  const auto found = peers_.find(message.connection);
  if (found == peers_.end()) return;
  if (message.is_incoming) {
    push({.kind = Event::Kind::message, .connection = message.connection, .identity = {}}, message.bytes);
  } else {
    found->second->send(message.delivery, message.bytes);
  }
}

void Hub::push(const Event& event, std::span<const std::byte> message) {
  const double received_s = telemetry::now_s();
  const std::lock_guard lock(mutex_);
  Event pushed = event;
  pushed.received_s = received_s;
  pushed.offset = static_cast<std::uint32_t>(inbox_.bytes.size());
  pushed.size = static_cast<std::uint32_t>(message.size());
  inbox_.bytes.insert(inbox_.bytes.end(), message.begin(), message.end());
  inbox_.events.push_back(pushed);
}

void Hub::set_metrics(std::string_view text) {
  const std::lock_guard lock(mutex_);
  metrics_ = text;
}

std::string Hub::metrics() const {
  const std::lock_guard lock(mutex_);
  return metrics_;
}

bool Hub::wait_until_empty(double seconds) {
  std::unique_lock lock(mutex_);
  return client_left_.wait_for(lock, std::chrono::duration<double>(seconds),
                               [this] { return counters_.admitted.load(std::memory_order_relaxed) == 0; });
}

void Hub::add(const std::shared_ptr<Peer>& peer) {
  const bool is_new = peers_.insert_or_assign(peer->id(), peer).second;
  not_admitted_[peer->id()] = peer.get();
  if (!is_new) return;
  EdgeCounters::add(counters_.connections);
  counters_.open.store(peers_.size(), std::memory_order_relaxed);
  if (not_admitted_.size() > config_.limits.not_admitted) close_oldest_not_admitted();
}

void Hub::close_oldest_not_admitted() {
  Peer& oldest = *not_admitted_.begin()->second;
  EdgeCounters::add(counters_.closed[index_of(CloseCode::too_many)]);
  oldest.abort();
  not_admitted_.erase(oldest.id());
}

void Hub::remove(Peer& peer) {
  not_admitted_.erase(peer.id());
  if (peer.is_admitted()) {
    push({.kind = Event::Kind::closed, .connection = peer.id(), .identity = {}}, {});
    {
      const std::lock_guard lock(mutex_);
      counters_.admitted.store(counters_.admitted.load(std::memory_order_relaxed) - 1, std::memory_order_relaxed);
    }
    client_left_.notify_all();
    delays_.forget(peer.id());
  }
  close_address(peer.address());
  peers_.erase(peer.id());
  counters_.open.store(peers_.size(), std::memory_order_relaxed);
}

void Hub::admit(Peer& peer, bool watches, std::span<const std::byte> hello) {
  const ClientMessage message = read_client_message(hello);
  const auto* const greeting = std::get_if<Hello>(&message);
  if (greeting == nullptr) {
    const auto* const malformed = std::get_if<Malformed>(&message);
    return refuse(peer, CloseCode::malformed, malformed != nullptr ? malformed->reason : "expected hello first");
  }
  const double now = telemetry::now_s();
  if (!addresses_.may_try(peer.address(), peer.is_loopback(), now)) {
    return refuse(peer, CloseCode::too_many, "too many wrong tokens from this address; wait a few seconds");
  }
  const Admission::Decision decision = admission_.admit(greeting->token, watches, std::time(nullptr));
  if (!decision.reason.empty()) {
    addresses_.add_wrong_token(peer.address(), now);
    return refuse(peer, decision.refusal, decision.reason);
  }
  if (counters_.admitted.load(std::memory_order_relaxed) >= config_.max_clients) {
    return refuse(peer, CloseCode::full, "this world has as many clients as it may have");
  }
  peer.set_admitted();
  not_admitted_.erase(peer.id());
  EdgeCounters::add(counters_.admitted);
  push({.kind = Event::Kind::opened, .connection = peer.id(), .identity = decision.identity}, {});
}

void Hub::receive(const Peer& peer, std::span<const std::byte> message) {
  if (delays_.applies_to(peer.id(), peer.address())) {
    return delays_.add(peer.id(), true, may_be_lost(message), Delivery::newest, message);
  }
  push({.kind = Event::Kind::message, .connection = peer.id(), .identity = {}}, message);
}

void Hub::refuse(Peer& peer, CloseCode code, const std::string& reason) {
  EdgeCounters::add(counters_.closed[index_of(code)]);
  peer.close(code, reason);
}

void Hub::start_sweep() {
  sweep_timer_.expires_after(std::chrono::seconds(1));
  sweep_timer_.async_wait([this](const error_code& error) {
    if (error) return;
    sweep(telemetry::now_s());
    start_sweep();
  });
}

void Hub::sweep(double now) {
  std::vector<std::shared_ptr<Peer>> stalled, silent;
  for (const auto& [id, peer] : peers_) {
    const double stalled_since = peer->stalled_since(), closing_since = peer->closing_since();
    if (closing_since != 0) {
      if (now - closing_since > closing_limit_s) stalled.push_back(peer);
    } else if (stalled_since != 0 && now - stalled_since > config_.limits.slow_reader_s) {
      EdgeCounters::add(counters_.closed[index_of(CloseCode::timeout)]);
      stalled.push_back(peer);
    } else if (!peer->is_admitted() && now > peer->deadline_s()) {
      silent.push_back(peer);
    }
  }
  for (const auto& peer : stalled) peer->abort();
  for (const auto& peer : silent) refuse(*peer, CloseCode::timeout, "no hello within the time limit");
  addresses_.clean(now);
}

void Hub::abort_all() {
  sweep_timer_.cancel();
  const auto peers = peers_;
  for (const auto& [id, peer] : peers) peer->abort();
}

}  // namespace ringfence::gateway
