#include <string>

#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <doctest/doctest.h>

#include "gateway/edge/certificate.hpp"
#include "gateway/edge/test_client.hpp"
#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

namespace ssl = boost::asio::ssl;
using SecureSocket = ssl::stream<boost::asio::ip::tcp::socket>;

EdgeConfig config_of(const Certificate& certificate) {
  EdgeConfig config = test_config();
  config.certificate_file = certificate.certificate_file();
  config.key_file = certificate.key_file();
  return config;
}

/// Connects with at most the version `newest`; 0: any. Only `certificate` is trusted.
boost::system::error_code handshake(const Edge& edge, const Certificate& certificate, int newest) {
  boost::asio::io_context io;
  ssl::context context(ssl::context::tls_client);
  context.load_verify_file(certificate.certificate_file());
  context.set_verify_mode(ssl::verify_peer);
  SSL_CTX_set_min_proto_version(context.native_handle(), TLS1_VERSION);
  SSL_CTX_set_max_proto_version(context.native_handle(), newest);
  SSL_CTX_set_security_level(context.native_handle(), 0);
  SecureSocket socket(io, context);
  socket.next_layer().connect({boost::asio::ip::address_v4::loopback(), port_of(edge)});
  boost::system::error_code error;
  socket.handshake(SecureSocket::client, error);
  return error;
}

TEST_CASE("messages pass through TLS in both directions") {
  const Certificate certificate("pass");
  Edge edge(config_of(certificate));
  CHECK(edge.url().starts_with("https://127.0.0.1:"));
  Frames frames(edge);
  boost::asio::io_context io;
  ssl::context context(ssl::context::tls_client);
  context.load_verify_file(certificate.certificate_file());
  context.set_verify_mode(ssl::verify_peer);
  boost::beast::websocket::stream<SecureSocket> socket(io, context);
  socket.next_layer().next_layer().connect({boost::asio::ip::address_v4::loopback(), port_of(edge)});
  socket.next_layer().handshake(SecureSocket::client);
  socket.binary(true);
  socket.handshake("127.0.0.1", "/play");
  const Bytes first = hello();
  socket.write(boost::asio::buffer(first.data(), first.size()));
  const ConnectionId connection = frames.next().connection;
  const Bytes large(500'000, std::byte{7});
  frames.add(connection, Delivery::reliable, large);
  frames.send();
  boost::beast::flat_buffer buffer;
  socket.read(buffer);
  CHECK(buffer.size() == large.size());
  frames.close(connection, CloseCode::replaced, "again");
  frames.send();
  boost::system::error_code error;
  buffer.clear();
  socket.read(buffer, error);
  CHECK(error == boost::beast::websocket::error::closed);
  CHECK(socket.reason().code == 4409);
  CHECK(frames.next().kind == Event::Kind::closed);
}

TEST_CASE("TLS 1.2 and 1.3 are accepted, older versions are not") {
  const Certificate certificate("versions");
  const Edge edge(config_of(certificate));
  CHECK_FALSE(handshake(edge, certificate, TLS1_3_VERSION));
  CHECK_FALSE(handshake(edge, certificate, TLS1_2_VERSION));
  CHECK(handshake(edge, certificate, TLS1_1_VERSION));
  CHECK(handshake(edge, certificate, TLS1_VERSION));
}

TEST_CASE("plain text at a TLS port, and a handshake that stops, are closed without an answer of HTTP") {
  const Certificate certificate("plain");
  EdgeConfig config = config_of(certificate);
  config.limits.hello_s = 0.1;
  const Edge edge(config);
  RawClient plain(edge), half(edge);
  plain.send("GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n");
  CHECK(plain.read_to_end().find("HTTP/1.1") == std::string::npos);
  half.send("\x16\x03\x01");
  CHECK(half.read_to_end().empty());
}

TEST_CASE("a certificate and a key that do not belong together are refused") {
  const Certificate one("one"), other("other");
  EdgeConfig config = config_of(one);
  config.key_file = other.key_file();
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains("does not fit the certificate"), Error);
}

}  // namespace
}  // namespace ringfence::gateway
