#include "dds/link_events.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>

#include <sys/epoll.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::dds {

LinkEvents::LinkEvents() : set_(::epoll_create1(EPOLL_CLOEXEC)) {
  if (set_ < 0) {
    throw Error(std::string("the process cannot wait for links (epoll): ") + std::strerror(errno) +
                "; raise the limit on open files (ulimit -n)");
  }
}

LinkEvents::~LinkEvents() { ::close(set_); }

void LinkEvents::add(const LinkSocket& socket, std::uint64_t tag, bool awaits_room) const noexcept {
  epoll_event event{};
  event.events = EPOLLIN | EPOLLRDHUP | EPOLLET;
  if (awaits_room) {
    event.events |= EPOLLOUT;
  }
  event.data.u64 = tag;
  if (::epoll_ctl(set_, EPOLL_CTL_ADD, socket.number(), &event) != 0) {
    ::epoll_ctl(set_, EPOLL_CTL_MOD, socket.number(), &event);
  }
}

void LinkEvents::remove(const LinkSocket& socket) const noexcept {
  ::epoll_ctl(set_, EPOLL_CTL_DEL, socket.number(), nullptr);
}

void LinkEvents::include(const LinkEvents& other, std::uint64_t tag) const noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = tag;
  ::epoll_ctl(set_, EPOLL_CTL_ADD, other.set_, &event);
}

void LinkEvents::exclude(const LinkEvents& other) const noexcept {
  ::epoll_ctl(set_, EPOLL_CTL_DEL, other.set_, nullptr);
}

std::size_t LinkEvents::take_some(std::array<std::uint64_t, most>& tags) const noexcept {
  epoll_event events[most];
  const int count = ::epoll_wait(set_, events, most, 0);
  const auto found = static_cast<std::size_t>(std::max(count, 0));
  for (std::size_t i = 0; i < found; ++i) {
    tags[i] = events[i].data.u64;
  }
  return found;
}

}  // namespace ringfence::dds
