#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/edge/admission.hpp"
#include "gateway/edge/test_client.hpp"

namespace ringfence::gateway {
namespace {

TEST_CASE("a connection is opened by its hello, its messages arrive in order, and then it is closed") {
  Edge edge(test_config());
  Frames frames(edge);
  ConnectionId connection = 0;
  {
    TestClient client(edge);
    client.send(hello());
    const Event opened = frames.next();
    CHECK(opened.kind == Event::Kind::opened);
    CHECK(opened.identity.role == Role::play);
    CHECK_FALSE(opened.identity.user);
    connection = opened.connection;
    for (int i = 0; i < 100; ++i) client.send(bytes_of("message " + std::to_string(i)));
    for (int i = 0; i < 100; ++i) {
      const Event event = frames.next();
      CHECK(event.kind == Event::Kind::message);
      CHECK(event.connection == connection);
      CHECK(frames.message == bytes_of("message " + std::to_string(i)));
    }
    client.socket().close(boost::beast::websocket::close_code::normal);
  }
  const Event closed = frames.next();
  CHECK(closed.kind == Event::Kind::closed);
  CHECK(closed.connection == connection);
}

TEST_CASE("a connection that breaks without a close frame is closed") {
  Edge edge(test_config());
  Frames frames(edge);
  {
    TestClient client(edge, "/watch");
    client.send(hello());
    CHECK(frames.next().identity.role == Role::watch);
  }
  CHECK(frames.next().kind == Event::Kind::closed);
}

TEST_CASE("fragments of a message arrive as one") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  frames.next();
  const Bytes part = bytes_of("abc");
  for (int i = 0; i < 9; ++i) client.socket().write_some(i == 8, boost::asio::buffer(part.data(), part.size()));
  frames.next();
  CHECK(frames.message == bytes_of("abcabcabcabcabcabcabcabcabc"));
}

TEST_CASE("reliable messages arrive all and in order, before the newest update") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  for (int i = 0; i < 1000; ++i) {
    frames.add(connection, Delivery::reliable, bytes_of(std::to_string(i)));
    if (i % 7 == 0) frames.send();
  }
  frames.close(connection, CloseCode::going_away, "the end");
  frames.send();
  for (int i = 0; i < 1000; ++i) {
    const auto message = client.read();
    REQUIRE(message);
    CHECK(*message == bytes_of(std::to_string(i)));
  }
  CHECK_FALSE(client.read());
  CHECK(client.closed().code == 1001);
  CHECK(client.closed().reason == "the end");
}

TEST_CASE("a client that reads slowly gets the newest update, and older ones only in order") {
  EdgeConfig config = test_config();
  config.limits.send_buffer = 8192;
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  const auto update = [](std::uint32_t number) {
    Bytes bytes(200'000);
    for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(number >> (8 * i));
    return bytes;
  };
  constexpr std::uint32_t last = 200;
  for (std::uint32_t i = 1; i <= last; ++i) {
    frames.add(connection, Delivery::newest, update(i));
    frames.send();
  }
  std::uint32_t received = 0, count = 0;
  while (received != last) {
    const auto message = client.read();
    REQUIRE(message);
    REQUIRE(message->size() == 200'000);
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < 4; ++i) number |= std::to_integer<std::uint32_t>((*message)[i]) << (8 * i);
    CHECK(number > received);
    received = number;
    ++count;
  }
  CHECK(count < last);
  CHECK(edge.statistics().replaced == last - count);
}

TEST_CASE("messages to many connections reach the right ones") {
  Edge edge(test_config());
  Frames frames(edge);
  std::vector<std::unique_ptr<TestClient>> clients;
  std::vector<ConnectionId> connections;
  for (int i = 0; i < 50; ++i) {
    clients.push_back(std::make_unique<TestClient>(edge));
    clients.back()->send(hello());
    connections.push_back(frames.next().connection);
  }
  for (int i = 0; i < 50; ++i) frames.add(connections[i], Delivery::newest, bytes_of("for " + std::to_string(i)));
  frames.add(123456789, Delivery::reliable, bytes_of("for a connection that is not there"));
  frames.send();
  for (int i = 0; i < 50; ++i) CHECK(clients[i]->read() == bytes_of("for " + std::to_string(i)));
  CHECK(edge.statistics().admitted == 50);
}

TEST_CASE("a guest comes back as its user with the token that it was given") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello(edge.guest_token(UserId(5))));
  CHECK(frames.next().identity.user == UserId(5));
}

TEST_CASE("an edge that stops accepting keeps its connections") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  edge.stop_accepting();
  frames.add(connection, Delivery::reliable, bytes_of("still here"));
  frames.send();
  CHECK(client.read() == bytes_of("still here"));
  // The acceptor was closed before the message was sent, since both pass through one queue.
  CHECK_THROWS(RawClient{edge});
}

TEST_CASE("an edge that is destroyed ends its connections") {
  auto edge = std::make_unique<Edge>(test_config());
  Frames frames(*edge);
  TestClient admitted(*edge), silent(*edge);
  RawClient raw(*edge);
  admitted.send(hello());
  frames.next();
  edge.reset();
  CHECK(admitted.read_to_close().code == 0);
  CHECK(silent.read_to_close().code == 0);
  CHECK(raw.read_to_end().empty());
}

}  // namespace
}  // namespace ringfence::gateway
