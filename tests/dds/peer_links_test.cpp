#include "dds/peer_links.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include <doctest/doctest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "dds/link_socket.hpp"
#include "node_world.hpp"

namespace ringfence::test {
namespace {

using dds::LinkAddress;
using dds::LinkSocket;
using dds::PeerLinks;
using dds::PeerRecord;
using Message = std::vector<std::byte>;

constexpr std::uint32_t loopback = 0x7f000001;
constexpr std::uint64_t world = 99;
/// Incarnations are names of the machine, so those of processes that run this test at the same time differ.
const std::uint64_t first_incarnation = static_cast<std::uint64_t>(getpid()) << 20;

/// One node of a group in which every node knows all others; its slot is its index.
struct Node {
  explicit Node(std::uint64_t incarnation) : links(incarnation, world, 1, 0) {}
  PeerLinks links;
  std::vector<std::vector<Message>> received;  ///< by slot of the sender
  std::vector<std::uint64_t> failures;         ///< incarnations
  std::size_t most_per_call = ~std::size_t{0};

  void step() {
    links.flush();
    links.take_events();
    std::size_t taken = 0;
    links.receive([&](NodeNumber slot, std::span<const std::byte> message) {
      if (taken++ == most_per_call) return false;
      received.resize(std::max<std::size_t>(received.size(), slot + 1));
      received[slot].emplace_back(message.begin(), message.end());
      return true;
    });
    links.take_failures([&](const PeerRecord& peer) { failures.push_back(peer.incarnation); });
  }
};

class Group {
 public:
  explicit Group(std::size_t nodes) {
    for (std::size_t slot = 0; slot < nodes; ++slot) nodes_.push_back(std::make_unique<Node>(first_incarnation + slot));
    for (std::size_t slot = 0; slot < nodes; ++slot) assign(slot);
  }
  Node& operator[](std::size_t slot) { return *nodes_[slot]; }
  std::vector<PeerRecord> peers_of(std::size_t slot) const {
    std::vector<PeerRecord> peers(nodes_.size());
    for (std::size_t peer = 0; peer < nodes_.size(); ++peer) {
      if (peer != slot && nodes_[peer] != nullptr) {
        peers[peer] = {first_incarnation + peer, {loopback, nodes_[peer]->links.port()}};
      }
    }
    return peers;
  }
  void assign(std::size_t slot) { nodes_[slot]->links.assign(peers_of(slot)); }
  void end(std::size_t slot) { nodes_[slot].reset(); }
  template <class Holds>
  bool run_until(Holds holds) {
    return wait_until([&] {
      for (const auto& node : nodes_) {
        if (node != nullptr) node->step();
      }
      return holds();
    });
  }

 private:
  std::vector<std::unique_ptr<Node>> nodes_;
};

Message message_of(std::size_t bytes, unsigned first) {
  Message message(bytes);
  for (std::size_t i = 0; i < bytes; ++i) message[i] = static_cast<std::byte>(first + i * 7);
  return message;
}

TEST_CASE("messages between nodes arrive complete, once and in order, whatever their size and the receiver's speed") {
  Group group(3);
  group[2].most_per_call = 3;
  std::vector<Message> sent;
  for (unsigned i = 0; i < 300; ++i) sent.push_back(message_of(1 + i * 109 % 32'768, i));
  for (const Message& message : sent) {
    group[0].links.add(1, message);
    group[0].links.add(2, message);
    group[1].links.add(2, message);
    group[2].links.add(0, message);
  }
  const auto has_all = [&](Node& node, std::size_t from) {
    return node.received.size() > from && node.received[from].size() == sent.size();
  };
  REQUIRE(group.run_until(
      [&] { return has_all(group[1], 0) && has_all(group[2], 0) && has_all(group[2], 1) && has_all(group[0], 2); }));
  CHECK(group[1].received[0] == sent);
  CHECK(group[2].received[0] == sent);
  CHECK(group[2].received[1] == sent);
  CHECK(group[0].received[2] == sent);
  for (std::size_t slot = 0; slot < 3; ++slot) CHECK(group[slot].failures.empty());
}

TEST_CASE("messages of a node that is not assigned wait until it is, and those of a node that is gone are refused") {
  Group group(2);
  std::vector<PeerRecord> none(2);
  group[1].links.assign(none);
  group[0].links.add(1, message_of(100, 1));
  for (int step = 0; step < 50; ++step) {
    group[0].step();
    group[1].step();
  }
  CHECK(group[1].received.empty());
  group.assign(1);
  REQUIRE(group.run_until([&] { return group[1].received.size() == 1 && group[1].received[0].size() == 1; }));

  std::vector<PeerRecord> successor = group.peers_of(1);
  successor[0].incarnation = 77;  // another node has the slot now
  group[1].links.assign(successor);
  group[0].links.add(1, message_of(100, 2));
  REQUIRE(group.run_until([&] { return !group[0].failures.empty(); }));  // its link was closed
  CHECK(group[1].received[0].size() == 1);
  CHECK(group[1].failures.empty());
}

TEST_CASE("a node that ends or does not listen is reported once, and what is sent to it is dropped") {
  Group group(3);
  group[1].links.add(0, message_of(8, 1));
  REQUIRE(group.run_until([&] { return group[0].received.size() == 2; }));
  group.end(1);
  group[2].links.add(1, message_of(8, 1));  // connects where no node listens any more
  REQUIRE(group.run_until([&] { return !group[0].failures.empty() && !group[2].failures.empty(); }));
  group[0].links.add(1, message_of(8, 2));
  for (int step = 0; step < 10; ++step) {
    group[0].step();
    group[2].step();
  }
  CHECK(group[0].failures == std::vector<std::uint64_t>{first_incarnation + 1});
  CHECK(group[2].failures == std::vector<std::uint64_t>{first_incarnation + 1});
}

TEST_CASE("a link that does not begin with a hello is closed, and invalid framing is a failure of its sender") {
  Group group(2);
  const LinkAddress address{loopback, group[0].links.port()};
  const auto sends = [&](std::span<const std::byte> bytes) {
    LinkSocket socket = LinkSocket::connect(address);
    std::size_t done = 0;
    const bool sent = wait_until([&] {
      std::size_t more = 0;
      if (socket.send(bytes.subspan(done), more) == LinkSocket::Result::closed) return true;
      done += more;
      return done == bytes.size();
    });
    Message nothing(64);
    const bool closed = wait_until([&] {
      group[0].step();
      std::size_t got = 0;
      return socket.receive(nothing, got) == LinkSocket::Result::closed;
    });
    return sent && closed;
  };
  CHECK(sends(message_of(64, 3)));
  CHECK(group[0].failures.empty());

  std::uint64_t for_another[4] = {dds::LinkHello::expected_magic, first_incarnation + 1, 9, 0};
  CHECK(sends(std::as_bytes(std::span(for_another))));
  CHECK(group[0].failures.empty());

  std::uint64_t hello[4] = {dds::LinkHello::expected_magic, first_incarnation + 1, first_incarnation,
                            0};  // then a message without bytes
  CHECK(sends(std::as_bytes(std::span(hello))));
  CHECK(group[0].failures == std::vector<std::uint64_t>{first_incarnation + 1});
}

TEST_CASE("the first link of the World is handed on with the bytes that follow its hello; a second one is closed") {
  Group group(1);
  const auto open = [&] {
    struct {
      dds::LinkHello hello{.sender = world, .receiver = first_incarnation};
      std::uint64_t first = 7;
    } const sent;
    LinkSocket socket = LinkSocket::connect({loopback, group[0].links.port()});
    std::size_t done = 0;
    CHECK(
        wait_until([&] { return socket.send(std::as_bytes(std::span(&sent, 1)), done) == LinkSocket::Result::done; }));
    return socket;
  };
  const LinkSocket socket = open();
  std::optional<dds::LinkStream> link;
  REQUIRE(group.run_until([&] { return (link = group[0].links.take_world_link()).has_value(); }));
  CHECK(wait_until([&] {
    link->note_events();
    link->receive(64);
    return link->received().size() == sizeof(std::uint64_t);
  }));
  CHECK(link->received()[0] == std::byte{7});

  const LinkSocket second = open();
  CHECK(group.run_until([&] {
    std::byte nothing[1];
    std::size_t got = 0;
    return second.receive(nothing, got) == LinkSocket::Result::closed;
  }));
  CHECK_FALSE(group[0].links.take_world_link().has_value());
  CHECK(group[0].failures.empty());
}

/// Allows this process so many open files, if the system does.
bool allow_open_files(rlim_t count) {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = std::max(limit.rlim_cur, std::min(count, limit.rlim_max));
  return setrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur >= count;
}

TEST_CASE("connections that never say hello do not keep other nodes out") {
  if (!allow_open_files(6000)) {
    MESSAGE("not tested: the system allows fewer than 6000 open files");
    return;
  }
  Group group(2);
  std::vector<LinkSocket> silent;
  for (std::size_t i = 0; i < 2100; ++i) {
    silent.push_back(LinkSocket::connect({loopback, group[1].links.port()}));
    REQUIRE(silent.back());
    if (i % 100 == 99) group[1].step();  // before the queue of connections that are not accepted is full
  }
  const Message message = message_of(100, 5);
  group[0].links.add(1, message);
  REQUIRE(group.run_until([&] { return !group[1].received.empty() && !group[1].received[0].empty(); }));
  CHECK(group[1].received[0][0] == message);
  CHECK(group[1].failures.empty());
}

}  // namespace
}  // namespace ringfence::test
