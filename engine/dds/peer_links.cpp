#include "dds/peer_links.hpp"

#include <algorithm>
#include <cstring>

#include "dds/parcel_channel.hpp"

namespace ringfence::dds {

PeerLinks::PeerLinks(std::uint64_t incarnation, std::uint64_t world, std::uint32_t first_port, std::uint32_t last_port)
    : incarnation_(incarnation),
      world_(world),
      listener_(LinkSocket::listen(first_port, last_port)),
      local_listener_(LinkSocket::listen_locally(incarnation)) {
  for (const LinkSocket* listener : {&listener_, &local_listener_}) {
    if (*listener) {
      events_.add(*listener, static_cast<std::uint64_t>(listener->number()));
    }
  }
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
    link.has_messages = true;  // messages of a peer that was assigned before this node may wait
  }
}

NodeNumber PeerLinks::slot_of(std::uint64_t incarnation) const noexcept {
  const auto at = std::find_if(peers_.begin(), peers_.end(),
                               [&](const Peer& peer) { return peer.record.incarnation == incarnation; });
  return at == peers_.end() ? no_slot : static_cast<NodeNumber>(at - peers_.begin());
}

// On one machine: as for CD nodes that are threads, for the memory is that of all pairs of neighbours.
LinkStream::RingBytes PeerLinks::rings() const noexcept {
  constexpr std::size_t few_nodes = 16;
  constexpr std::size_t large = std::size_t{1} << 18, small = std::size_t{1} << 16;
  return {peers_.size() <= few_nodes ? large : small, small};
}

void PeerLinks::add(NodeNumber slot, std::span<const std::byte> message) {
  Peer& peer = peers_[slot];
  if (peer.failed) {
    return;
  }
  if (!peer.out) {
    peer.out = LinkStream::connect(peer.record.address, peer.record.incarnation, rings());
    if (!peer.out) {
      return fail(slot);
    }
    peer.out.report_to(events_, static_cast<std::uint64_t>(peer.out.socket().number()));
    const LinkHello hello{.sender = incarnation_, .receiver = peer.record.incarnation};
    peer.out.append(std::as_bytes(std::span(&hello, 1)));
  }
  const Packing packing{static_cast<std::uint32_t>(message.size()), 0};
  peer.out.append(std::as_bytes(std::span(&packing, 1)));
  peer.out.append(message);
}

void PeerLinks::flush() {
  for (NodeNumber slot = 0; slot < peers_.size(); ++slot) {
    LinkStream& out = peers_[slot].out;
    if (out) {
      out.flush();
      if (out.is_closed()) {
        fail(slot);
      }
    }
  }
}

bool PeerLinks::has_unsent() const noexcept {
  return std::any_of(peers_.begin(), peers_.end(), [](const Peer& peer) { return peer.out.unsent() != 0; });
}

void PeerLinks::fail(NodeNumber slot) {
  Peer& peer = peers_[slot];
  peer.failed = true;
  peer.out = {};
}

void PeerLinks::take_events() {
  events_.take([this](std::uint64_t tag) { note_events(tag); });
}

void PeerLinks::note_events(std::uint64_t tag) {
  const auto is_it = [tag](const LinkSocket& socket) {
    return socket && static_cast<std::uint64_t>(socket.number()) == tag;
  };
  for (const LinkSocket* listener : {&listener_, &local_listener_}) {
    if (is_it(*listener)) {
      return accept_all(*listener);
    }
  }
  for (Incoming& link : incoming_) {
    if (is_it(link.stream.socket())) {
      return link.stream.note_events();
    }
  }
  for (NodeNumber slot = 0; slot < peers_.size(); ++slot) {
    LinkStream& out = peers_[slot].out;
    if (is_it(out.socket())) {
      out.note_events();
      out.receive(sizeof(Packing));  // the other end sends no messages
      if (out.is_closed()) {
        fail(slot);
      }
      return;
    }
  }
}

void PeerLinks::accept_all(const LinkSocket& listener) {
  const bool is_local = &listener == &local_listener_;
  for (LinkSocket socket = listener.accept(); socket; socket = listener.accept()) {
    if (make_room()) {
      Incoming link;
      link.stream = is_local ? LinkStream::accepted_locally(std::move(socket)) : LinkStream(std::move(socket));
      link.stream.report_to(events_, static_cast<std::uint64_t>(link.stream.socket().number()));
      incoming_.push_back(std::move(link));
    }
  }
}

bool PeerLinks::has_news() const noexcept {
  return std::any_of(incoming_.begin(), incoming_.end(), [](const Incoming& link) { return link.stream.has_news(); });
}

bool PeerLinks::arm(bool awaits_messages) noexcept {
  bool is_idle = true;
  for (Incoming& link : incoming_) {
    is_idle &= !awaits_messages || link.stream.arm();
  }
  for (Peer& peer : peers_) {
    is_idle &= peer.out.unsent() == 0 || peer.out.arm();
  }
  return is_idle;
}

void PeerLinks::disarm() noexcept {
  for (Incoming& link : incoming_) {
    link.stream.disarm();
  }
  for (Peer& peer : peers_) {
    peer.out.disarm();
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

// Reads until nothing is left or the link has as many bytes as it may; returns whether it has read any, or the link has
// closed. A link that does not begin with a hello for this node is closed.
bool PeerLinks::read(Incoming& link) {
  const auto most = [&] { return link.sender != 0 && slot_of(link.sender) != no_slot ? max_buffered : max_unknown; };
  bool any = false;
  while (link.stream.receive(most())) {
    any = true;
    if (link.sender == 0 && !read_hello(link)) {
      link.stream.close();
    }
  }
  return any || link.stream.is_closed();
}

// Returns false if the link is not for this node. The World's link is not kept here.
bool PeerLinks::read_hello(Incoming& link) {
  const std::span<const std::byte> received = link.stream.received();
  if (received.size() < sizeof(LinkHello)) {
    return true;
  }
  const auto hello = read_once<LinkHello>(received);
  if (hello.magic != LinkHello::expected_magic || hello.receiver != incarnation_ || hello.sender == 0) {
    return false;
  }
  link.stream.take(sizeof hello);
  if (hello.sender == world_) {
    if (!std::exchange(world_came_, true)) {
      events_.remove(link.stream.socket());
      world_link_ = std::exchange(link.stream, {});
    }
    return false;
  }
  link.sender = hello.sender;
  return true;
}

std::span<const std::byte> PeerLinks::first_message(std::span<const std::byte> received, bool& is_valid) noexcept {
  if (received.size() < sizeof(Packing)) {
    return {};
  }
  const auto packing = read_once<Packing>(received);
  is_valid = packing.bytes != 0 && packing.bytes <= ParcelChannel::largest_message;
  if (!is_valid || received.size() - sizeof packing < (std::size_t{packing.bytes} + 7) / 8 * 8) {
    return {};
  }
  return received.subspan(sizeof packing, packing.bytes);
}

void PeerLinks::erase_finished() {
  std::erase_if(incoming_, [&](const Incoming& link) {
    const NodeNumber slot = link.sender != 0 ? slot_of(link.sender) : no_slot;
    return slot != no_slot ? peers_[slot].failed : link.stream.is_closed();
  });
}

}  // namespace ringfence::dds
