#include "dds/link_socket.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <string>

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::dds {
namespace {

constexpr int backlog = 1024;
constexpr unsigned timeout_ms = 10'000;

sockaddr_in socket_address(LinkAddress address) noexcept {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = htonl(address.host);
  result.sin_port = htons(static_cast<std::uint16_t>(address.port));
  return result;
}

// Messages are collected before they are sent, so the system must not delay them further.
void set_options(int socket) noexcept {
  const int on = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, sizeof timeout_ms);
}

bool bind_to(int socket, std::uint32_t port) noexcept {
  const sockaddr_in address = socket_address({INADDR_ANY, port});
  return ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

/// An address without a file: it disappears with its socket.
struct LocalAddress {
  explicit LocalAddress(std::uint64_t name) noexcept {
    address.sun_family = AF_UNIX;
    const int written = std::snprintf(address.sun_path + 1, sizeof address.sun_path - 1, "ringfence-link-%016llx",
                                      static_cast<unsigned long long>(name));
    size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + static_cast<std::size_t>(written));
  }
  const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&address); }
  sockaddr_un address{};
  socklen_t size = 0;
};

bool is_local(int socket) noexcept {
  int domain = 0;
  socklen_t size = sizeof domain;
  return ::getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &domain, &size) == 0 && domain == AF_UNIX;
}

/// Whether the other end of a local socket was opened by a process of this user.
bool has_peer_of_same_user(int socket) noexcept {
  ucred peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.uid == ::geteuid();
}

/// Room for one file descriptor in the control part of a message.
union DescriptorRoom {
  cmsghdr header;
  char bytes[CMSG_SPACE(sizeof(int))];
};

bool is_blocked() noexcept { return errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOTCONN || errno == EINTR; }

}  // namespace

LinkSocket LinkSocket::listen(std::uint32_t first_port, std::uint32_t last_port) {
  LinkSocket listener(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  bool bound = false;
  for (std::uint32_t port = first_port; listener && !bound && port <= last_port; ++port) {
    bound = bind_to(listener.socket_, port);
  }
  if (!listener || !(bound || bind_to(listener.socket_, 0)) || ::listen(listener.socket_, backlog) != 0) {
    throw Error(std::string("a node cannot listen for links of other nodes (TCP): ") + std::strerror(errno));
  }
  return listener;
}

LinkSocket LinkSocket::connect(LinkAddress to) {
  LinkSocket link(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!link) {
    return {};
  }
  set_options(link.socket_);
  const sockaddr_in address = socket_address(to);
  if (::connect(link.socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      errno != EINPROGRESS) {
    return {};
  }
  return link;
}

LinkSocket LinkSocket::listen_locally(std::uint64_t name) noexcept {
  LinkSocket listener(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const LocalAddress address(name);
  if (!listener || ::bind(listener.socket_, address.get(), address.size) != 0 ||
      ::listen(listener.socket_, backlog) != 0) {
    return {};
  }
  return listener;
}

LinkSocket LinkSocket::connect_locally(std::uint64_t name) noexcept {
  LinkSocket link(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const LocalAddress address(name);
  if (!link || ::connect(link.socket_, address.get(), address.size) != 0 || !has_peer_of_same_user(link.socket_)) {
    return {};
  }
  return link;
}

LinkSocket LinkSocket::accept() const {
  for (;;) {
    LinkSocket link(::accept4(socket_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!link) {
      return link;
    }
    if (!is_local(link.socket_)) {
      set_options(link.socket_);
      return link;
    }
    if (has_peer_of_same_user(link.socket_)) {
      return link;
    }
  }
}

std::uint32_t LinkSocket::port() const {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  ::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

void LinkSocket::close() noexcept {
  if (socket_ >= 0) {
    ::close(std::exchange(socket_, -1));
  }
}

LinkSocket::Result LinkSocket::send(std::span<const std::byte> bytes, std::size_t& sent) const {
  sent = 0;
  while (sent < bytes.size()) {
    const ssize_t taken = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (taken < 0) {
      return is_blocked() ? Result::would_block : Result::closed;
    }
    sent += static_cast<std::size_t>(taken);
  }
  return Result::done;
}

LinkSocket::Result LinkSocket::send_descriptor(int descriptor) const noexcept {
  char byte = 0;
  iovec part{&byte, 1};
  DescriptorRoom room{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = room.bytes;
  message.msg_controllen = sizeof room.bytes;
  cmsghdr* const header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof descriptor);
  std::memcpy(CMSG_DATA(header), &descriptor, sizeof descriptor);
  if (::sendmsg(socket_, &message, MSG_NOSIGNAL) == 1) {
    return Result::done;
  }
  return is_blocked() ? Result::would_block : Result::closed;
}

// The room takes one descriptor, so the system closes any others.
LinkSocket::Result LinkSocket::receive_descriptor(int& descriptor) const noexcept {
  descriptor = -1;
  char byte = 0;
  iovec part{&byte, 1};
  DescriptorRoom room{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = room.bytes;
  message.msg_controllen = sizeof room.bytes;
  const ssize_t got = ::recvmsg(socket_, &message, MSG_CMSG_CLOEXEC);
  if (got < 0) {
    return is_blocked() ? Result::would_block : Result::closed;
  }
  const cmsghdr* const header = CMSG_FIRSTHDR(&message);
  if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_RIGHTS &&
      header->cmsg_len == CMSG_LEN(sizeof descriptor)) {
    std::memcpy(&descriptor, CMSG_DATA(header), sizeof descriptor);
  }
  return got == 0 ? Result::closed : Result::done;
}

LinkSocket::Result LinkSocket::receive(std::span<std::byte> room, std::size_t& got) const noexcept {
  const ssize_t read = ::recv(socket_, room.data(), room.size(), 0);
  got = read > 0 ? static_cast<std::size_t>(read) : 0;
  if (read < 0) {
    return is_blocked() ? Result::would_block : Result::closed;
  }
  return read == 0 && !room.empty() ? Result::closed : Result::done;
}

std::uint64_t LinkSocket::retransmitted_bytes() const noexcept {
  tcp_info info{};
  socklen_t size = sizeof info;
  return ::getsockopt(socket_, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? info.tcpi_bytes_retrans : 0;
}

}  // namespace ringfence::dds
