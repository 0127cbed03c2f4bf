#include "dds/peer_links.hpp"

#include <algorithm>
#include <cstring>

#include "dds/parcel_channel.hpp"

namespace ringfence::dds {

PeerLinks::PeerLinks(std::uint64_t incarnation, std::uint64_t world, std::uint32_t first_port, std::uint32_t last_port)
    : incarnation_(incarnation), world_(world), listener_(LinkSocket::listen(first_port, last_port)) {
  events_.add(listener_, static_cast<std::uint64_t>(listener_.number()));
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
  for (Incoming& link : incoming_) {
    link.readable = true;  // messages of a peer that was assigned before this node may wait
  }
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
    peer.out = LinkSocket::connect(peer.record.address);
    if (!peer.out) {
      return fail(slot);
    }
    events_.add(peer.out, static_cast<std::uint64_t>(peer.out.number()));
    const LinkHello hello{.sender = incarnation_, .receiver = peer.record.incarnation};
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

bool PeerLinks::has_unsent() const noexcept {
  return std::any_of(peers_.begin(), peers_.end(), [](const Peer& peer) { return !peer.unsent.empty(); });
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

void PeerLinks::take_events() {
  events_.take([this](std::uint64_t tag) { note_events(tag); });
}

void PeerLinks::note_events(std::uint64_t tag) {
  const auto is_it = [tag](const LinkSocket& socket) {
    return socket && static_cast<std::uint64_t>(socket.number()) == tag;
  };
  if (is_it(listener_)) {
    return accept_all();
  }
  for (Incoming& link : incoming_) {
    if (is_it(link.socket)) {
      link.readable = true;
      return;
    }
  }
  for (NodeNumber slot = 0; slot < peers_.size(); ++slot) {
    if (is_it(peers_[slot].out) && peers_[slot].out.is_closed()) {
      fail(slot);
    }
  }
}

void PeerLinks::accept_all() {
  for (LinkSocket socket = listener_.accept(); socket; socket = listener_.accept()) {
    if (make_room()) {
      events_.add(socket, static_cast<std::uint64_t>(socket.number()));
      Incoming link;
      link.socket = std::move(socket);
      incoming_.push_back(std::move(link));
    }
  }
}

// Who can reach the port can open connections that never say hello. When there are too many, the oldest of them makes
// room: nodes send their hello with their first bytes.
bool PeerLinks::make_room() {
  if (incoming_.size() < max_incoming) {
    return true;
  }
  const auto silent =
      std::find_if(incoming_.begin(), incoming_.end(), [](const Incoming& link) { return link.sender == 0; });
  if (silent == incoming_.end()) {
    return false;
  }
  incoming_.erase(silent);
  return true;
}

// Reads until nothing is left or `most` bytes are buffered. A link that does not begin with a hello for this node is
// closed.
void PeerLinks::read(Incoming& link, std::size_t most) {
  constexpr std::size_t at_once = std::size_t{1} << 16;
  std::copy(link.bytes.begin() + static_cast<std::ptrdiff_t>(link.begin),
            link.bytes.begin() + static_cast<std::ptrdiff_t>(link.end), link.bytes.begin());
  link.end -= std::exchange(link.begin, 0);
  auto result = LinkSocket::Result::done;
  while (!link.closed && result == LinkSocket::Result::done && link.end < most) {
    const std::size_t room = std::min(at_once, most - link.end);
    link.bytes.resize(std::max(link.bytes.size(), link.end + room));
    std::size_t got = 0;
    result = link.socket.receive(std::span(link.bytes).subspan(link.end, room), got);
    link.end += got;
  }
  link.readable = result == LinkSocket::Result::done && !link.closed;
  link.closed |= result == LinkSocket::Result::closed;
  if (link.sender == 0 && !read_hello(link)) {
    link.closed = true;
    link.end = link.begin;
  }
}

// Returns false if the link is not for this node. The World's link is not kept here.
bool PeerLinks::read_hello(Incoming& link) {
  LinkHello hello;
  if (link.received().size() < sizeof hello) {
    return true;
  }
  std::memcpy(&hello, link.received().data(), sizeof hello);
  if (hello.magic != LinkHello::expected_magic || hello.receiver != incarnation_ || hello.sender == 0) {
    return false;
  }
  link.begin += sizeof hello;
  if (hello.sender == world_) {
    if (!std::exchange(world_came_, true)) {
      events_.remove(link.socket);
      world_link_ = WorldLink{std::move(link.socket), {link.received().begin(), link.received().end()}};
    }
    return false;
  }
  link.sender = hello.sender;
  return true;
}

std::span<const std::byte> PeerLinks::first_message(std::span<const std::byte> received, bool& is_valid) noexcept {
  Packing packing;
  if (received.size() < sizeof packing) {
    return {};
  }
  std::memcpy(&packing, received.data(), sizeof packing);
  is_valid = packing.bytes != 0 && packing.bytes <= ParcelChannel::largest_message;
  if (!is_valid || received.size() - sizeof packing < (std::size_t{packing.bytes} + 7) / 8 * 8) {
    return {};
  }
  return received.subspan(sizeof packing, packing.bytes);
}

void PeerLinks::erase_finished() {
  std::erase_if(incoming_, [&](const Incoming& link) {
    const NodeNumber slot = link.sender != 0 ? slot_of(link.sender) : no_slot;
    return slot != no_slot ? peers_[slot].failed : link.closed;
  });
}

}  // namespace ringfence::dds
