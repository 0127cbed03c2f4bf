#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <boost/asio/read_until.hpp>
#include <doctest/doctest.h>

#include "gateway/edge/address_limits.hpp"
#include "gateway/edge/admission.hpp"
#include "gateway/edge/test_client.hpp"

namespace ringfence::gateway {
namespace {

std::uint64_t closed(const Edge& edge, CloseCode code) { return edge.statistics().closed[index_of(code)]; }

TEST_CASE("a text message is refused with 1003, before and after the hello") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient first(edge), second(edge);
  first.socket().text(true);
  first.send(bytes_of("text"));
  CHECK(first.read_to_close().code == 1003);
  second.send(hello());
  frames.next();
  second.socket().text(true);
  second.send(bytes_of("text"));
  CHECK(second.read_to_close().code == 1003);
  CHECK(frames.next().kind == Event::Kind::closed);
  CHECK(closed(edge, CloseCode::text) == 2);
}

TEST_CASE("a message of 2048 bytes is received, and one more byte refused with 1009, also in fragments") {
  Edge edge(test_config());
  Frames frames(edge);
  TestClient whole(edge), parts(edge);
  whole.send(hello());
  frames.next();
  whole.send(Bytes(max_client_message));
  CHECK(frames.next().size == max_client_message);
  whole.send(Bytes(max_client_message + 1));
  CHECK(whole.read_to_close().code == 1009);
  CHECK(frames.next().kind == Event::Kind::closed);
  const Bytes part(1025);
  parts.socket().write_some(false, boost::asio::buffer(part.data(), part.size()));
  parts.socket().write_some(true, boost::asio::buffer(part.data(), part.size()));
  CHECK(parts.read_to_close().code == 1009);
  CHECK(closed(edge, CloseCode::too_big) == 2);
}

TEST_CASE("a first message that is no hello is refused with 4400") {
  Edge edge(test_config());
  Bytes other_version = hello();
  other_version[1] = std::byte{2};
  Bytes acknowledgement;
  write(Ack{1}, acknowledgement);
  for (const Bytes& message : {Bytes{}, bytes_of("\x01"), other_version, acknowledgement, Bytes(2048)}) {
    TestClient client(edge);
    client.send(message);
    const Closed end = client.read_to_close();
    CHECK(end.code == 4400);
    CHECK(!end.reason.empty());
  }
  CHECK(closed(edge, CloseCode::malformed) == 5);
}

TEST_CASE("a wrong token is refused with 4401, and one for the other path with 4403") {
  EdgeConfig config = test_config();
  config.token_key = std::string(32, 'k');
  Edge edge(config);
  const auto end = [&](const std::string& token, const std::string& path) {
    TestClient client(edge, path);
    client.send(hello(token));
    return client.read_to_close().code;
  };
  const std::int64_t later = std::time(nullptr) + 1000;
  CHECK(end("", "/play") == 4401);
  CHECK(end("no token", "/play") == 4401);
  CHECK(end(sign_token({UserId(1), Role::play, "test", 1}, config.token_key), "/play") == 4401);
  CHECK(end(sign_token({UserId(1), Role::play, "other", later}, config.token_key), "/play") == 4401);
  CHECK(end(sign_token({UserId(1), Role::play, "test", later}, config.token_key), "/watch") == 4403);
  CHECK(end(sign_token({UserId(1), Role::operate, "test", later}, config.token_key), "/play") == 4403);
  TestClient client(edge);
  client.send(hello(sign_token({UserId(1), Role::play, "test", later}, config.token_key)));
  Frames frames(edge);
  CHECK(frames.next().identity.user == UserId(1));
}

TEST_CASE("a WebSocket without a hello is closed with 4408, and slow requests without an answer") {
  EdgeConfig config = test_config();
  config.limits.hello_s = 0.1;
  Edge edge(config);
  TestClient silent(edge);
  RawClient nothing(edge), half(edge);
  half.send("GET / HTTP/1.1\r\nHost:");
  CHECK(silent.read_to_close().code == 4408);
  CHECK(nothing.read_to_end().empty());
  CHECK(half.read_to_end().empty());
  // The edge counts before it closes.
  CHECK(closed(edge, CloseCode::timeout) == 3);
}

TEST_CASE("a connection that is idle after a reply ends, and is not counted as refused") {
  EdgeConfig config = test_config();
  config.limits.hello_s = 0.1;
  Edge edge(config);
  RawClient client(edge);
  client.send("GET /healthz HTTP/1.1\r\nHost: test\r\n\r\n");
  CHECK(client.read_to_end().ends_with("ok\n"));
  CHECK(closed(edge, CloseCode::timeout) == 0);
}

TEST_CASE("fragments count as messages, so that a message in many of them is refused with 4429") {
  EdgeConfig config = test_config();
  config.limits.messages_per_s = 0.001;
  config.limits.message_burst = 100;
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  frames.next();
  const Bytes part(1);
  boost::system::error_code error;  // the edge closes the connection in the meantime
  for (int i = 0; i < 1000 && !error; ++i)
    client.socket().write_some(false, boost::asio::buffer(part.data(), 1), error);
  CHECK(client.read_to_close().code == 4429);
  CHECK(closed(edge, CloseCode::too_many) == 1);
}

TEST_CASE("a connection is forgotten that is refused while an invalid frame waits to be read") {
  Edge edge(test_config());
  RawClient client(edge);
  client.send(
      "GET /play HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n");
  std::string reply;
  boost::asio::read_until(client.socket(), boost::asio::dynamic_buffer(reply), "\r\n\r\n");
  // A message that is no hello, and a frame with an opcode that does not exist.
  client.send(std::string_view("\x82\x81\0\0\0\0\x09\x8f\x80\0\0\0\0", 13));
  CHECK(client.read_to_end().starts_with("\x88"));
  while (edge.statistics().open != 0) std::this_thread::yield();
  CHECK(closed(edge, CloseCode::malformed) == 1);
}

TEST_CASE("a client that sends too many messages is closed with 4429, and others are not") {
  EdgeConfig config = test_config();
  config.limits.messages_per_s = 0.001;
  config.limits.message_burst = 10;
  Edge edge(config);
  Frames frames(edge);
  TestClient calm(edge), flood(edge);
  calm.send(hello());
  frames.next();
  flood.send(hello());
  const ConnectionId connection = frames.next().connection;
  for (int i = 0; i < 11; ++i) flood.send(bytes_of("x"));
  for (int i = 0; i < 10; ++i) CHECK(frames.next().kind == Event::Kind::message);
  CHECK(flood.read_to_close().code == 4429);
  const Event end = frames.next();
  CHECK(end.kind == Event::Kind::closed);
  CHECK(end.connection == connection);
  calm.send(bytes_of("calm"));
  frames.next();
  CHECK(frames.message == bytes_of("calm"));
}

TEST_CASE("pings count as messages") {
  EdgeConfig config = test_config();
  config.limits.messages_per_s = 0.001;
  config.limits.message_burst = 10;
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  frames.next();
  boost::system::error_code error;
  for (int i = 0; i < 11; ++i) client.socket().ping({}, error);
  CHECK(client.read_to_close().code == 4429);
}

TEST_CASE("one client more than allowed is closed with 4503, and admitted when another has left") {
  EdgeConfig config = test_config();
  config.max_clients = 2;
  Edge edge(config);
  Frames frames(edge);
  TestClient first(edge), third(edge);
  {
    TestClient second(edge);
    first.send(hello());
    second.send(hello());
    frames.next();
    frames.next();
    third.send(hello());
    CHECK(third.read_to_close().code == 4503);
  }
  CHECK(frames.next().kind == Event::Kind::closed);
  TestClient fourth(edge);
  fourth.send(hello());
  CHECK(frames.next().kind == Event::Kind::opened);
}

TEST_CASE("a client with too many messages waiting is disconnected") {
  EdgeConfig config = test_config();
  config.limits.send_buffer = 8192;
  config.limits.waiting_bytes = 1 << 20;
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  // Far more than the buffers of both sockets and the limit.
  for (int i = 0; i < 400; ++i) {
    frames.add(connection, Delivery::reliable, Bytes(100'000));
    frames.send();
  }
  CHECK(frames.next().kind == Event::Kind::closed);
  CHECK(closed(edge, CloseCode::timeout) == 1);
}

TEST_CASE("a client that does not read is disconnected") {
  EdgeConfig config = test_config();
  config.limits.send_buffer = 8192;
  config.limits.slow_reader_s = 0.1;
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge), reader(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  reader.send(hello());
  const ConnectionId other = frames.next().connection;
  frames.add(connection, Delivery::newest, Bytes(20'000'000));
  frames.send();
  const Event end = frames.next();
  CHECK(end.kind == Event::Kind::closed);
  CHECK(end.connection == connection);
  CHECK(closed(edge, CloseCode::timeout) == 1);
  frames.add(other, Delivery::newest, bytes_of("on"));
  frames.send();
  CHECK(reader.read() == bytes_of("on"));
}

TEST_CASE("of more connections without a hello than allowed, the oldest are closed") {
  EdgeConfig config = test_config();
  config.limits.not_admitted = 8;
  Edge edge(config);
  Frames frames(edge);
  TestClient admitted(edge);
  admitted.send(hello());
  frames.next();
  std::vector<std::unique_ptr<RawClient>> half_open;
  for (int i = 0; i < 40; ++i) half_open.push_back(std::make_unique<RawClient>(edge));
  for (int i = 0; i < 32; ++i) CHECK(half_open[i]->read_to_end().empty());
  CHECK(closed(edge, CloseCode::too_many) == 32);
  admitted.send(bytes_of("on"));
  frames.next();
  CHECK(frames.message == bytes_of("on"));
}

TEST_CASE("an address has a limited number of connections, a loopback address does not") {
  EdgeLimits limits;
  limits.connections_per_address = 2;
  AddressLimits addresses(limits);
  CHECK(addresses.open("192.0.2.1", false));
  CHECK(addresses.open("192.0.2.1", false));
  CHECK_FALSE(addresses.open("192.0.2.1", false));
  CHECK(addresses.open("192.0.2.2", false));
  addresses.close("192.0.2.1");
  CHECK(addresses.open("192.0.2.1", false));
  for (int i = 0; i < 10; ++i) CHECK(addresses.open("127.0.0.1", true));
}

TEST_CASE("an address that sends wrong tokens is blocked until its allowance is full again, and then forgotten") {
  EdgeLimits limits;
  limits.wrong_tokens_per_s = 5;
  limits.wrong_token_burst = 20;
  AddressLimits addresses(limits);
  double now = 100;
  for (int i = 0; i < 21; ++i) {
    CHECK(addresses.may_try("192.0.2.1", false, now));
    addresses.add_wrong_token("192.0.2.1", now);
  }
  CHECK_FALSE(addresses.may_try("192.0.2.1", false, now));
  CHECK(addresses.may_try("192.0.2.2", false, now));
  CHECK_FALSE(addresses.may_try("192.0.2.1", false, now + 3.9));
  addresses.clean(now + 3.9);
  CHECK_FALSE(addresses.may_try("192.0.2.1", false, now + 3.9));
  CHECK(addresses.may_try("192.0.2.1", false, now + 4.1));
  addresses.clean(now + 4.1);
  CHECK(addresses.size() == 0);
}

}  // namespace
}  // namespace ringfence::gateway
