#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>

#include "gateway/edge/edge.hpp"
#include "gateway/protocol/client_messages.hpp"

namespace ringfence::gateway {

using Bytes = std::vector<std::byte>;

inline Bytes bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}
inline Bytes hello(std::string_view token = {}) {
  Bytes bytes;
  write(Hello{token}, bytes);
  return bytes;
}

/// Limits and a port for tests: any free port of the loopback address.
inline EdgeConfig test_config() {
  EdgeConfig config;
  config.port = 0;
  config.world = "test";
  return config;
}
inline std::uint16_t port_of(const Edge& edge) {
  return static_cast<std::uint16_t>(std::stoi(edge.url().substr(edge.url().rfind(':') + 1)));
}

/// A TCP connection that waits for whatever it reads.
class RawClient {
 public:
  explicit RawClient(const Edge& edge) : socket_(io_) {
    socket_.connect({boost::asio::ip::address_v4::loopback(), port_of(edge)});
  }
  void send(std::string_view text) { boost::asio::write(socket_, boost::asio::buffer(text.data(), text.size())); }
  /// All that arrives until the other side closes the connection.
  std::string read_to_end() {
    std::string all;
    boost::system::error_code error;
    boost::asio::read(socket_, boost::asio::dynamic_buffer(all), error);
    return all;
  }
  boost::asio::ip::tcp::socket& socket() { return socket_; }

 private:
  boost::asio::io_context io_;
  boost::asio::ip::tcp::socket socket_;
};

/// The answer to one request. `lines`: further header lines, each with its end.
inline boost::beast::http::response<boost::beast::http::string_body> request(const Edge& edge, const std::string& path,
                                                                             const std::string& lines = {},
                                                                             const std::string& method = "GET") {
  namespace http = boost::beast::http;
  RawClient client(edge);
  client.send(method + " " + path + " HTTP/1.1\r\nHost: test\r\nConnection: close\r\n" + lines + "\r\n");
  boost::beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  if (method == "HEAD") parser.skip(true);
  http::read(client.socket(), buffer, parser);
  return parser.release();
}

/// A close frame, or the end of a connection without one: code 0.
struct Closed {
  unsigned code = 0;
  std::string reason;
};

/// A WebSocket that waits for whatever it reads.
class TestClient {
 public:
  explicit TestClient(const Edge& edge, const std::string& path = "/play") : socket_(io_) {
    socket_.next_layer().connect({boost::asio::ip::address_v4::loopback(), port_of(edge)});
    socket_.auto_fragment(false);
    socket_.binary(true);
    socket_.handshake("127.0.0.1:" + std::to_string(port_of(edge)), path);
  }
  void send(const Bytes& message) {
    boost::system::error_code ignored;  // a test reads why the connection has ended
    socket_.write(boost::asio::buffer(message.data(), message.size()), ignored);
  }
  /// The next message; empty if the connection has ended, then closed() says why.
  std::optional<Bytes> read() {
    boost::beast::flat_buffer buffer;
    boost::system::error_code error;
    socket_.read(buffer, error);
    if (error) {
      if (error == boost::beast::websocket::error::closed) {
        const auto& reason = socket_.reason();
        closed_ = {reason.code, {reason.reason.data(), reason.reason.size()}};
      }
      return std::nullopt;
    }
    const auto* const first = static_cast<const std::byte*>(buffer.data().data());
    return Bytes(first, first + buffer.size());
  }
  /// Reads until the connection ends.
  Closed read_to_close() {
    while (read()) {
    }
    return closed_;
  }
  const Closed& closed() const { return closed_; }
  boost::beast::websocket::stream<boost::asio::ip::tcp::socket>& socket() { return socket_; }

 private:
  boost::asio::io_context io_;
  boost::beast::websocket::stream<boost::asio::ip::tcp::socket> socket_;
  Closed closed_;
};

/// The side of the frames.
class Frames {
 public:
  explicit Frames(Edge& edge) : edge_(&edge) {}
  /// The next event; waits for it. Its message is in `message`.
  Event next() {
    while (at_ == inbox_.events.size()) {
      edge_->receive(inbox_);
      at_ = 0;
      std::this_thread::yield();
    }
    const Event event = inbox_.events[at_++];
    const auto bytes = event.kind == Event::Kind::message ? inbox_.message(event) : std::span<const std::byte>();
    message.assign(bytes.begin(), bytes.end());
    return event;
  }
  void add(ConnectionId connection, Delivery delivery, const Bytes& bytes) {
    outbox_.messages.push_back({connection, delivery, static_cast<std::uint32_t>(outbox_.bytes.size()),
                                static_cast<std::uint32_t>(bytes.size())});
    outbox_.bytes.insert(outbox_.bytes.end(), bytes.begin(), bytes.end());
  }
  void close(ConnectionId connection, CloseCode code, const std::string& reason) {
    outbox_.closes.push_back({connection, code, reason});
  }
  void send() { edge_->send(outbox_); }

  Bytes message;

 private:
  Edge* edge_;
  Inbox inbox_;
  std::size_t at_ = 0;
  Outbox outbox_;
};

}  // namespace ringfence::gateway
