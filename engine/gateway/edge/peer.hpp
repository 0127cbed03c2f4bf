#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// One TCP connection, in whatever it does: TLS handshake, HTTP, WebSocket. It belongs to the thread of the edge.
class Peer {
 public:
  Peer(ConnectionId id, std::string address, bool is_loopback, double deadline_s)
      : id_(id), address_(std::move(address)), is_loopback_(is_loopback), deadline_s_(deadline_s) {}
  virtual ~Peer() = default;
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  ConnectionId id() const noexcept { return id_; }
  const std::string& address() const noexcept { return address_; }
  bool is_loopback() const noexcept { return is_loopback_; }
  /// When it is closed if its hello was not accepted before; seconds of a steady clock.
  double deadline_s() const noexcept { return deadline_s_; }
  /// Whether its hello was accepted.
  bool is_admitted() const noexcept { return is_admitted_; }
  void set_admitted() noexcept { is_admitted_ = true; }

  /// Sends a message when the connection is ready for it; nothing if it has no WebSocket.
  virtual void send(Delivery delivery, std::span<const std::byte> message) = 0;
  /// Closes it in order, after the messages that wait.
  virtual void close(CloseCode code, const std::string& reason) = 0;
  /// Closes the socket at once.
  virtual void abort() noexcept = 0;
  /// Since when a write has made no progress, seconds of that clock; 0: none waits.
  virtual double stalled_since() const noexcept { return 0; }
  /// Since when it is being closed; 0: it is not.
  virtual double closing_since() const noexcept { return 0; }

 private:
  ConnectionId id_;
  std::string address_;
  bool is_loopback_;
  double deadline_s_;
  bool is_admitted_ = false;
};

}  // namespace ringfence::gateway
