#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

#include "gateway/edge/address_limits.hpp"
#include "gateway/edge/admission.hpp"
#include "gateway/edge/asio.hpp"
#include "gateway/edge/delay_line.hpp"
#include "gateway/edge/edge_config.hpp"
#include "gateway/edge/edge_statistics.hpp"
#include "gateway/edge/page_files.hpp"
#include "gateway/edge/peer.hpp"

namespace ringfence::gateway {

/// All connections of an edge, and what passes between them and the thread of the frames.
///
/// Threads: take(), send(), set_metrics(), metrics(), counters() and admission() may be called by any thread; the rest
/// belongs to the thread that runs `io`.
class Hub {
 public:
  Hub(net::io_context& io, const EdgeConfig& config);

  // For any thread.
  void take(Inbox& inbox);
  void send(Outbox& outbox);
  void set_metrics(std::string_view text);
  std::string metrics() const;
  /// Waits until no client is admitted; false if some are after that time.
  bool wait_until_empty(double seconds);
  const EdgeCounters& counters() const noexcept { return counters_; }
  const Admission& admission() const noexcept { return admission_; }

  // For connections.
  const EdgeConfig& config() const noexcept { return config_; }
  const PageFiles& page() const noexcept { return page_; }
  EdgeCounters& counters() noexcept { return counters_; }
  ConnectionId next_id() noexcept { return ++last_id_; }
  /// A connection that begins, or goes on as another object with the same id.
  void add(const std::shared_ptr<Peer>& peer);
  /// The connection has ended.
  void remove(Peer& peer);
  /// Reads the first message of a WebSocket. Closes the connection if it is refused.
  void admit(Peer& peer, bool watches, std::span<const std::byte> hello);
  /// A later message.
  void receive(const Peer& peer, std::span<const std::byte> message);
  /// Closes a connection and counts the reason.
  void refuse(Peer& peer, CloseCode code, const std::string& reason);
  /// Whether an address may connect; counts it.
  bool open_address(const std::string& address, bool is_loopback) { return addresses_.open(address, is_loopback); }
  void close_address(const std::string& address) { addresses_.close(address); }
  /// Closes the connections whose time is over at a time of the steady clock. It is called every second.
  void sweep(double now_s);
  /// Aborts all connections.
  void abort_all();

 private:
  void deliver_pending();
  void deliver(Outbox& outbox);
  void deliver_delayed(DelayLine::Message& message);
  void push(const Event& event, std::span<const std::byte> message);
  void close_oldest_not_admitted();
  void start_sweep();

  net::io_context& io_;
  EdgeConfig config_;
  Admission admission_;
  PageFiles page_;
  AddressLimits addresses_;
  EdgeCounters counters_;
  ConnectionId last_id_ = 0;
  std::unordered_map<ConnectionId, std::shared_ptr<Peer>> peers_;
  std::map<ConnectionId, Peer*> not_admitted_;  ///< in order of age
  Timer sweep_timer_;
  DelayLine delays_;

  std::condition_variable client_left_;
  mutable std::mutex mutex_;  ///< of what follows, and of the end of an admission
  Inbox inbox_;
  Outbox outbox_;
  bool is_posted_ = false;  ///< deliver_pending() will run
  std::string metrics_;
  Outbox delivered_;  ///< of the thread of the edge: its memory is used again
};

}  // namespace ringfence::gateway
