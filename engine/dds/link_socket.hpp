#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "dds/wire.hpp"

namespace ringfence::dds {

/// A TCP socket that never blocks, closed with its owner. Movable, not copyable. Threads: one.
///
/// A connection closes if sent bytes are not acknowledged for 10 s, or a receiver does not read for that long: a
/// process reads between the stages of a frame, and leases detect lost processes sooner.
class LinkSocket {
 public:
  /// Result of an operation on a socket.
  enum class Result : std::uint8_t { done, would_block, closed };

  LinkSocket() = default;
  ~LinkSocket() { close(); }
  LinkSocket(LinkSocket&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}
  LinkSocket& operator=(LinkSocket&& other) noexcept {
    std::swap(socket_, other.socket_);
    return *this;
  }

  /// Listens on all interfaces, on the first free port from `first_port` to `last_port`; if there is none, on a port
  /// that the system chooses. Throws Error if that fails.
  static LinkSocket listen(std::uint32_t first_port, std::uint32_t last_port);
  /// Starts to connect; what is sent meanwhile would block. An empty socket if that fails at once.
  static LinkSocket connect(LinkAddress to);
  /// The next connection that another process has opened; empty if there is none.
  LinkSocket accept() const;

  /// The port of a listening socket.
  std::uint32_t port() const;
  int number() const noexcept { return socket_; }
  explicit operator bool() const noexcept { return socket_ >= 0; }
  void close() noexcept;

  /// Sends as much as the system takes, and sets `sent` to the number of bytes.
  Result send(std::span<const std::byte> bytes, std::size_t& sent) const;
  /// Writes what has arrived to `room`, and sets `got` to the number of bytes. `done` if there may be more.
  Result receive(std::span<std::byte> room, std::size_t& got) const noexcept;
  /// Whether the other end has closed the connection, if it never sends anything.
  bool is_closed() const noexcept;
  /// Bytes that the system has sent again so far.
  std::uint64_t retransmitted_bytes() const noexcept;

 private:
  explicit LinkSocket(int socket) noexcept : socket_(socket) {}

  int socket_ = -1;
};

}  // namespace ringfence::dds
