#include "dds/link_socket.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::dds {
namespace {

constexpr int backlog = 1024;

sockaddr_in socket_address(LinkAddress address) noexcept {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = htonl(address.host);
  result.sin_port = htons(static_cast<std::uint16_t>(address.port));
  return result;
}

// Messages are collected before they are sent, so the system must not delay them further.
void send_at_once(int socket) noexcept {
  const int on = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

bool bind_to(int socket, std::uint32_t port) noexcept {
  const sockaddr_in address = socket_address({INADDR_ANY, port});
  return ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

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

LinkSocket LinkSocket::connect(LinkAddress to, double timeout_ms) {
  LinkSocket link(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!link) {
    return {};
  }
  send_at_once(link.socket_);
  const auto timeout = static_cast<unsigned>(std::ceil(timeout_ms));
  ::setsockopt(link.socket_, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout, sizeof timeout);
  const sockaddr_in address = socket_address(to);
  if (::connect(link.socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      errno != EINPROGRESS) {
    return {};
  }
  return link;
}

LinkSocket LinkSocket::accept() const {
  return LinkSocket(::accept4(socket_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
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

bool LinkSocket::is_closed() const noexcept {
  std::byte nothing;
  const ssize_t got = ::recv(socket_, &nothing, 1, MSG_PEEK);
  return got == 0 || (got < 0 && !is_blocked());
}

LinkSocket::Result LinkSocket::receive(std::vector<std::byte>& to, std::size_t most) const {
  const std::size_t before = to.size();
  to.resize(before + most);
  const ssize_t got = ::recv(socket_, to.data() + before, most, 0);
  to.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  if (got < 0) {
    return is_blocked() ? Result::would_block : Result::closed;
  }
  return got == 0 ? Result::closed : Result::done;
}

}  // namespace ringfence::dds
