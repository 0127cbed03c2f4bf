#include "dds/peer_links.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "facade/config_check.hpp"
#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

constexpr std::size_t largest_message = std::size_t{1} << 15;  ///< half of a node's ring

}  // namespace

PeerLinks::PeerLinks(std::uint64_t incarnation, std::uint32_t first_port, std::uint32_t last_port, double timeout_ms,
                     std::function<void()> wake)
    : incarnation_(incarnation),
      timeout_ms_(timeout_ms),
      wake_(std::move(wake)),
      listener_(LinkSocket::listen(first_port, last_port)),
      events_set_(::epoll_create1(EPOLL_CLOEXEC)),
      end_event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  epoll_event end{};
  end.events = EPOLLIN;
  end.data.fd = end_event_;
  if (events_set_ < 0 || end_event_ < 0 || ::epoll_ctl(events_set_, EPOLL_CTL_ADD, end_event_, &end) != 0) {
    throw Error(std::string("a node cannot wait for links of other nodes: ") + std::strerror(errno));
  }
  watch(listener_);
  try {
    waiter_ = std::thread([this] { wait_for_events(); });
  } catch (const std::system_error&) {
    throw Error("the system has no thread for the links between nodes; raise the limit on threads (ulimit -u)");
  }
}

PeerLinks::~PeerLinks() {
  const std::uint64_t end = 1;
  while (::write(end_event_, &end, sizeof end) < 0 && errno == EINTR) {
  }
  waiter_.join();
  ::close(events_set_);
  ::close(end_event_);
}

// Edge-triggered: an event wakes the owner once, and the owner reads until nothing is left.
void PeerLinks::wait_for_events() {
  for (;;) {
    epoll_event events[16];
    const int count = ::epoll_wait(events_set_, events, 16, -1);
    for (int i = 0; i < count; ++i) {
      if (events[i].data.fd == end_event_) {
        return;
      }
    }
    if (count > 0) {
      events_.store(true, std::memory_order_release);
      wake_();
    }
  }
}

void PeerLinks::watch(const LinkSocket& socket) const {
  epoll_event event{};
  event.events = EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET;
  event.data.fd = socket.number();
  ::epoll_ctl(events_set_, EPOLL_CTL_ADD, socket.number(), &event);
}

void PeerLinks::assign(std::span<const PeerRecord> peers) {
  std::vector<Peer> old = std::exchange(peers_, std::vector<Peer>(peers.size()));
  for (std::size_t slot = 0; slot < peers.size(); ++slot) {
    const auto same = [&](const Peer& peer) { return peer.record.incarnation == peers[slot].incarnation; };
    const auto known = std::find_if(old.begin(), old.end(), same);
    if (peers[slot].incarnation != 0 && known != old.end()) {
      peers_[slot] = std::move(*known);
    }
    peers_[slot].record = peers[slot];
  }
  std::erase_if(incoming_, [&](const Incoming& link) { return link.sender != 0 && slot_of(link.sender) == no_slot; });
  held_ = true;  // messages of a peer that was assigned before this node may wait
}

NodeNumber PeerLinks::slot_of(std::uint64_t incarnation) const noexcept {
  const auto at = std::find_if(peers_.begin(), peers_.end(),
                               [&](const Peer& peer) { return peer.record.incarnation == incarnation; });
  return at == peers_.end() ? no_slot : static_cast<NodeNumber>(at - peers_.begin());
}

void PeerLinks::add(NodeNumber slot, std::span<const std::byte> message) {
  Peer& peer = peers_[slot];
  if (peer.failed) {
    return;
  }
  const auto append = [&](const void* bytes, std::size_t size) {
    const auto* const first = static_cast<const std::byte*>(bytes);
    peer.unsent.insert(peer.unsent.end(), first, first + size);
  };
  if (!peer.out) {
    peer.out = LinkSocket::connect(peer.record.address, timeout_ms_);
    if (!peer.out) {
      return fail(slot);
    }
    watch(peer.out);
    Hello hello;
    hello.sender = incarnation_;
    hello.receiver = peer.record.incarnation;
    append(&hello, sizeof hello);
  }
  const Packing packing{static_cast<std::uint32_t>(message.size()), 0};
  append(&packing, sizeof packing);
  append(message.data(), message.size());
  peer.unsent.resize((peer.unsent.size() + 7) / 8 * 8);
}

void PeerLinks::flush() {
  for (Peer& peer : peers_) {
    if (peer.sent != peer.unsent.size() && !peer.failed) {
      send(peer);
    }
  }
}

void PeerLinks::send(Peer& peer) {
  std::size_t sent = 0;
  if (peer.out.send(std::span(peer.unsent).subspan(peer.sent), sent) == LinkSocket::Result::closed) {
    return fail(static_cast<NodeNumber>(&peer - peers_.data()));
  }
  peer.sent += sent;
  if (peer.sent == peer.unsent.size()) {
    peer.unsent.clear();
    peer.sent = 0;
  }
}

void PeerLinks::fail(NodeNumber slot) {
  Peer& peer = peers_[slot];
  peer.failed = true;
  peer.out.close();
  peer.unsent.clear();
  peer.sent = 0;
}

void PeerLinks::accept_all() {
  for (LinkSocket socket = listener_.accept(); socket; socket = listener_.accept()) {
    if (incoming_.size() < 2 * facade::max_nodes) {
      watch(socket);
      incoming_.push_back({std::move(socket), 0, {}, 0, false});
    }
  }
}

void PeerLinks::find_closed() {
  for (NodeNumber slot = 0; slot < peers_.size(); ++slot) {
    if (peers_[slot].out && peers_[slot].out.is_closed()) {
      fail(slot);
    }
  }
}

// Reads until nothing is left or `most` bytes are buffered. A link that does not begin with a hello for this node is
// closed.
void PeerLinks::read(Incoming& link, std::size_t most) {
  constexpr std::size_t at_once = std::size_t{1} << 16;
  auto result = LinkSocket::Result::done;
  while (!link.closed && result == LinkSocket::Result::done && link.bytes.size() < most) {
    result = link.socket.receive(link.bytes, std::min(at_once, most - link.bytes.size()));
  }
  held_ |= result == LinkSocket::Result::done && !link.closed;
  link.closed |= result == LinkSocket::Result::closed;
  if (link.sender == 0 && !read_hello(link)) {
    link.closed = true;
    link.bytes.clear();
  }
}

bool PeerLinks::read_hello(Incoming& link) {
  if (link.bytes.size() < sizeof(Hello)) {
    return true;
  }
  Hello hello;
  std::memcpy(&hello, link.bytes.data(), sizeof hello);
  if (hello.magic != Hello{}.magic || hello.receiver != incarnation_ || hello.sender == 0) {
    return false;
  }
  link.sender = hello.sender;
  link.taken = sizeof hello;
  return true;
}

// Empty if the next message is not complete, or not valid.
std::span<const std::byte> PeerLinks::next_message(const Incoming& link, bool& is_valid) noexcept {
  const std::size_t left = link.bytes.size() - link.taken;
  Packing packing;
  if (left < sizeof packing) {
    return {};
  }
  std::memcpy(&packing, link.bytes.data() + link.taken, sizeof packing);
  is_valid = packing.bytes != 0 && packing.bytes <= largest_message;
  if (!is_valid || left - sizeof packing < (std::size_t{packing.bytes} + 7) / 8 * 8) {
    return {};
  }
  return std::span(link.bytes).subspan(link.taken + sizeof packing, packing.bytes);
}

void PeerLinks::drop_taken(Incoming& link) {
  link.bytes.erase(link.bytes.begin(), link.bytes.begin() + static_cast<std::ptrdiff_t>(link.taken));
  link.taken = 0;
}

void PeerLinks::erase_finished() {
  std::erase_if(incoming_, [&](const Incoming& link) {
    const NodeNumber slot = link.sender != 0 ? slot_of(link.sender) : no_slot;
    return slot != no_slot ? peers_[slot].failed : link.closed;
  });
}

}  // namespace ringfence::dds
