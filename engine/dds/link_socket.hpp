#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "dds/wire.hpp"

namespace ringfence::dds {

/// A stream socket that never blocks, closed with its owner: TCP, or a local one between processes of one machine.
/// Movable, not copyable. Threads: one.
///
/// A local socket has a number as its name, which exists in the network namespace of its process. Only processes of the
/// same user can connect. A TCP connection closes if sent bytes are not acknowledged for 10 s, or a receiver does not
/// read for that long: a process reads between the stages of a frame, and leases detect lost processes sooner.
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
  /// Listens for local connections to that name; empty if the system refuses.
  static LinkSocket listen_locally(std::uint64_t name) noexcept;
  /// Connects to a local socket; empty, at once, if no process of this machine and user listens with that name.
  static LinkSocket connect_locally(std::uint64_t name) noexcept;
  /// The next connection that another process has opened; empty if there is none. Local connections of other users
  /// are closed.
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
  /// Sends one byte, and a file descriptor with it: only over a local socket.
  Result send_descriptor(int descriptor) const noexcept;
  /// Receives one byte, and sets `descriptor` to the file descriptor that came with it; -1 if none came.
  Result receive_descriptor(int& descriptor) const noexcept;
  /// Bytes that the system has sent again so far.
  std::uint64_t retransmitted_bytes() const noexcept;

 private:
  explicit LinkSocket(int socket) noexcept : socket_(socket) {}

  int socket_ = -1;
};

}  // namespace ringfence::dds
