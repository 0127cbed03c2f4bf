#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <doctest/doctest.h>
#include <unistd.h>

#include "gateway/edge/test_client.hpp"
#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

namespace http = boost::beast::http;

/// A directory with a page, and a file beside it.
class PageDirectory {
 public:
  PageDirectory() : root_(std::filesystem::temp_directory_path() / ("gateway_http_test." + std::to_string(getpid()))) {
    std::filesystem::create_directories(root_ / "web" / "sub");
    write(root_ / "secret.txt", "secret");
    write(root_ / "web" / "index.html", "<!doctype html>");
    write(root_ / "web" / "sub" / "page.js", "export {};");
    write(root_ / "web" / "empty.css", "");
  }
  ~PageDirectory() { std::filesystem::remove_all(root_); }
  std::string web() const { return (root_ / "web").string(); }

 private:
  static void write(const std::filesystem::path& path, const std::string& text) { std::ofstream(path) << text; }
  std::filesystem::path root_;
};

TEST_CASE("files of the page are served with their type, and nothing else is") {
  const PageDirectory page;
  EdgeConfig config = test_config();
  config.page_directory = page.web();
  const Edge edge(config);
  const auto index = request(edge, "/");
  CHECK(index.result() == http::status::ok);
  CHECK(index.body() == "<!doctype html>");
  CHECK(index[http::field::content_type] == "text/html; charset=utf-8");
  const auto script = request(edge, "/sub/page.js?version=1");
  CHECK(script.body() == "export {};");
  CHECK(script[http::field::content_type] == "text/javascript; charset=utf-8");
  CHECK(request(edge, "/empty.css").result() == http::status::ok);
  for (const char* const path : {"/../secret.txt", "/sub/../../secret.txt", "/%2e%2e/secret.txt", "//secret.txt",
                                 "/sub", "/sub/", "/..\\secret.txt", "/nothing"}) {
    CAPTURE(path);
    const auto reply = request(edge, path);
    CHECK(reply.result() == http::status::not_found);
    CHECK(reply.body().find("secret\n") == std::string::npos);
  }
}

TEST_CASE("a file that has not changed is not sent again") {
  const PageDirectory page;
  EdgeConfig config = test_config();
  config.page_directory = page.web();
  const Edge edge(config);
  const std::string tag(request(edge, "/")[http::field::etag]);
  REQUIRE(!tag.empty());
  const auto again = request(edge, "/", "If-None-Match: " + tag + "\r\n");
  CHECK(again.result() == http::status::not_modified);
  CHECK(again.body().empty());
  CHECK(request(edge, "/", "If-None-Match: \"other\"\r\n").result() == http::status::ok);
}

TEST_CASE("replies allow the page to use its own host only") {
  const Edge edge(test_config());
  for (const char* const path : {"/", "/healthz", "/nothing"}) {
    const auto reply = request(edge, path);
    CHECK(reply["Content-Security-Policy"].find("default-src 'self'") != boost::beast::string_view::npos);
    CHECK(reply["X-Content-Type-Options"] == "nosniff");
  }
}

TEST_CASE("HEAD has the header of GET and no body; other methods are refused") {
  const Edge edge(test_config());
  const auto get = request(edge, "/healthz"), head = request(edge, "/healthz", {}, "HEAD");
  CHECK(get.body() == "ok\n");
  CHECK(head.body().empty());
  CHECK(head[http::field::content_length] == get[http::field::content_length]);
  CHECK(request(edge, "/", {}, "DELETE").result() == http::status::method_not_allowed);
}

TEST_CASE("metrics are in the Prometheus text format, those of the frames first") {
  Edge edge(test_config());
  edge.set_metrics("# HELP frames_total Frames.\n# TYPE frames_total counter\nframes_total 12\n");
  const auto reply = request(edge, "/metrics");
  CHECK(reply[http::field::content_type].starts_with("text/plain; version=0.0.4"));
  CHECK(reply.body().starts_with("# HELP frames_total"));
  std::istringstream lines(reply.body());
  std::string line, declared;
  std::size_t samples = 0;
  while (std::getline(lines, line)) {
    CAPTURE(line);
    std::istringstream words(line);
    std::string first, kind, name, type;
    words >> first;
    if (first == "#") {
      words >> kind >> name >> type;
      REQUIRE((kind == "HELP" || kind == "TYPE"));
      if (kind == "HELP") continue;
      CHECK((type == "counter" || type == "gauge"));
      declared = name;
      continue;
    }
    const std::size_t label = first.find('{');
    CHECK(first.substr(0, label) == declared);
    if (label != std::string::npos) {
      CHECK(first.substr(label, 7) == "{code=\"");
      CHECK(first.ends_with("\"}"));
    }
    std::uint64_t value = 0;
    CHECK((words >> value && words.eof()));
    ++samples;
  }
  CHECK(samples > 10);
  CHECK(reply.body().ends_with('\n'));
}

TEST_CASE("WebSockets are at /play and /watch only, and for allowed origins only") {
  const std::string upgrade =
      "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";
  const auto status = [&](const Edge& edge, const std::string& path, const std::string& origin,
                          const std::string& host = "game.example") {
    RawClient client(edge);
    client.send("GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: Upgrade\r\n" + upgrade +
                (origin.empty() ? "" : "Origin: " + origin + "\r\n") + "\r\n");
    boost::beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    http::read_header(client.socket(), buffer, parser);
    return parser.get().result_int();
  };
  EdgeConfig with_key = test_config();
  with_key.token_key = std::string(32, 'k');
  const Edge any(with_key);
  CHECK(status(any, "/play", "") == 101);
  CHECK(status(any, "/watch", "https://game.example") == 101);
  CHECK(status(any, "/play", "https://other.example") == 403);
  CHECK(status(any, "/play", "null") == 403);
  CHECK(status(any, "/other", "") == 404);
  // A page of another site whose name has the address of this machine is not that of a guest.
  const Edge guests(test_config());
  CHECK(status(guests, "/play", "") == 101);
  CHECK(status(guests, "/play", "http://game.example") == 403);
  CHECK(status(guests, "/play", "http://127.game.example", "127.game.example") == 403);
  CHECK(status(guests, "/play", "http://localhost:8080", "localhost:8080") == 101);
  CHECK(status(guests, "/play", "http://127.0.0.1:8080", "127.0.0.1:8080") == 101);
  CHECK(status(guests, "/play", "http://[::1]:8080", "[::1]:8080") == 101);
  EdgeConfig config = test_config();
  config.origins = {"https://page.example"};
  const Edge listed(config);
  CHECK(status(listed, "/play", "https://page.example") == 101);
  CHECK(status(listed, "/play", "https://page.example.evil.example") == 403);
  CHECK(status(listed, "/play", "https://game.example") == 403);
  CHECK(request(any, "/play").result_int() == 426);
}

TEST_CASE("bytes that are no request, and headers without end, close the connection") {
  const Edge edge(test_config());
  RawClient garbage(edge);
  garbage.send(std::string("\x16\x03\x01\x02\x00 not HTTP\r\n\r\n", 18));
  CHECK(garbage.read_to_end().find("200 OK") == std::string::npos);
  RawClient large(edge);
  large.send("GET / HTTP/1.1\r\nX: " + std::string(9000, 'x'));
  CHECK(large.read_to_end().find("200 OK") == std::string::npos);
  RawClient body(edge);
  body.send("GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\n12345");
  CHECK(body.read_to_end().find("200 OK") == std::string::npos);
}

TEST_CASE("addresses that other machines reach need TLS and a key for tokens") {
  EdgeConfig config = test_config();
  config.host = "0.0.0.0";
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains("certificate"), Error);
  config.certificate_file = "missing.pem";
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains("both a certificate and its key"), Error);
  config.key_file = "missing.pem";
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains("missing.pem"), Error);
  config = test_config();
  config.host = "somewhere";
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains("somewhere"), Error);
}

TEST_CASE("a port that is in use is named in the error") {
  const Edge first(test_config());
  EdgeConfig config = test_config();
  config.port = port_of(first);
  CHECK_THROWS_WITH_AS(Edge{config}, doctest::Contains(std::to_string(config.port).c_str()), Error);
}

}  // namespace
}  // namespace ringfence::gateway
