#include "nodes/cd_node/peer_inbox.hpp"

#include <array>
#include <cstring>
#include <map>
#include <vector>

#include <doctest/doctest.h>

#include "messages/run.hpp"

namespace ringfence::nodes {
namespace {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;
using Verdict = PeerInbox::Verdict;

void send(link::Channel& channel, std::uint64_t frame) {
  const auto room = channel.sender().claim(sizeof(messages::Header));
  REQUIRE(!room.empty());
  messages::write_header(room.data(), {MessageType::probe, Endpoint::node(1), Endpoint::node(0), frame, 1}, 0, 0, true,
                         0);
  channel.sender().commit(room.size());
  channel.sender().publish();
}

/// Takes the messages of one frame and leaves those of later ones.
struct Reader {
  PeerInbox inbox;
  std::uint64_t frame = 0;
  std::vector<std::uint64_t> taken;
  int refused = 0;

  bool read() {
    return inbox.read(
        0,
        [&](const MessageView& message) {
          const std::uint64_t of = message.header().frame;
          return of < frame ? Verdict::drop : of > frame ? Verdict::wait : Verdict::take;
        },
        [&](const MessageView& message) { taken.push_back(message.header().frame); }, [&] { ++refused; });
  }
};

Connection from(link::Channel& channel) {
  Connection connection;
  connection.in = &channel.receiver();
  return connection;
}

}  // namespace

TEST_CASE("a message that has to wait stays, with all behind it, and is taken when its frame has come") {
  link::Channel first(4096, nullptr, nullptr), second(4096, nullptr, nullptr);
  Reader reader;
  const std::array<Connection, 3> peers{Connection{}, from(first), from(second)};
  reader.inbox.assign(peers);
  reader.frame = 5;
  for (const std::uint64_t frame : {5, 6, 5, 6}) send(first, frame);
  send(second, 5);
  CHECK(reader.read());
  CHECK(reader.taken == std::vector<std::uint64_t>{5, 5});
  CHECK(!reader.read());
  reader.inbox.assign(peers);  // between frames: nothing is lost
  reader.frame = 6;
  reader.taken.clear();
  CHECK(reader.read());
  CHECK(reader.taken == std::vector<std::uint64_t>{6, 6});  // that of frame 5 between them came too late
}

TEST_CASE("a ring has room again when its messages were taken, also after one has waited") {
  link::Channel ring(4096, nullptr, nullptr);
  Reader reader;
  const std::array<Connection, 1> peers{from(ring)};
  reader.inbox.assign(peers);
  for (reader.frame = 0; reader.frame < 500; ++reader.frame) {
    send(ring, reader.frame);
    send(ring, reader.frame + 1);
    reader.read();
    ++reader.frame;
    reader.read();
  }
  CHECK(reader.taken.size() == 500);
}

TEST_CASE("peers that share one ring are read once, and a ring of a peer that is gone is forgotten") {
  link::Channel ring(4096, nullptr, nullptr), other(4096, nullptr, nullptr);
  Reader reader;
  const std::array<Connection, 3> peers{from(ring), from(ring), from(other)};
  reader.inbox.assign(peers);
  send(ring, 0);
  send(other, 7);
  CHECK(reader.read());
  CHECK(reader.taken.size() == 1);
  reader.inbox.assign(std::span(peers).first(2));
  reader.frame = 7;
  CHECK(!reader.read());
}

TEST_CASE("bytes that are no message are refused") {
  link::Channel ring(4096, nullptr, nullptr);
  Reader reader;
  const std::array<Connection, 1> peers{from(ring)};
  reader.inbox.assign(peers);
  std::memset(ring.sender().claim(64).data(), 0x5a, 64);
  ring.sender().commit(64);
  ring.sender().publish();
  CHECK(reader.read());
  CHECK(reader.refused == 1);
  CHECK(reader.taken.empty());
}

}  // namespace ringfence::nodes
