#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "gateway/edge/edge_config.hpp"
#include "gateway/edge/edge_statistics.hpp"
#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// Clients over HTTP and WebSocket on one port, with or without TLS. One thread of its own does everything that has to
/// do with sockets, and checks the hello of each connection, so that the thread of the frames sees only clients that
/// were admitted.
///
/// Failure: the constructor throws Error, which says what to change. Threads: any one at a time.
class Edge final : public Transport {
 public:
  explicit Edge(const EdgeConfig& config);
  /// Aborts all connections and ends the thread.
  ~Edge() override;
  Edge(const Edge&) = delete;
  Edge& operator=(const Edge&) = delete;

  /// "http://127.0.0.1:8080" or "https://..."
  const std::string& url() const noexcept;
  /// A token with which a guest can come back; empty if there are no guests.
  std::string guest_token(UserId user) const;
  EdgeStatistics statistics() const;
  /// Stops listening.
  void stop_accepting();
  /// Waits until all admitted connections have ended; false if some are left after `seconds`.
  bool wait_until_empty(double seconds);

  void receive(Inbox& inbox) override;
  void send(Outbox& outbox) override;
  void set_metrics(std::string_view text) override;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::gateway
