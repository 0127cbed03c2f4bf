#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include <boost/asio/ssl/stream_base.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "gateway/edge/asio.hpp"
#include "gateway/edge/edge_statistics.hpp"
#include "gateway/edge/http_replies.hpp"
#include "gateway/edge/hub.hpp"
#include "gateway/edge/peer.hpp"
#include "gateway/edge/websocket_session.hpp"

namespace ringfence::gateway {

/// A connection until its upgrade to a WebSocket: reads requests and answers them.
template <class Stream>
class HttpSession final : public Peer, public std::enable_shared_from_this<HttpSession<Stream>> {
 public:
  HttpSession(Hub& hub, Stream&& stream, ConnectionId id, std::string address, bool is_loopback, double deadline_s)
      : Peer(id, std::move(address), is_loopback, deadline_s), hub_(hub), stream_(std::move(stream)) {}

  void start() {
    set_deadline(hub_.config().limits.hello_s);
    if constexpr (std::is_same_v<Stream, TlsStream>) {
      stream_.async_handshake(net::ssl::stream_base::server,
                              [self = this->shared_from_this()](const error_code& error) {
                                if (error) return self->fail(error);
                                self->read();
                              });
    } else {
      read();
    }
  }

  void send(Delivery, std::span<const std::byte>) override {}
  void close(CloseCode, const std::string&) override { abort(); }
  void abort() noexcept override {
    if (!is_finished_) beast::get_lowest_layer(stream_).close();
  }

 private:
  static constexpr std::size_t max_header = 8192, max_body = 0;

  /// The time for the next handshake, request or reply.
  void set_deadline(double seconds) {
    beast::get_lowest_layer(stream_).expires_after(std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9)));
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(max_header);
    parser_->body_limit(max_body);
    beast::http::async_read(
        stream_, received_, *parser_,
        [self = this->shared_from_this()](const error_code& error, std::size_t) { self->on_read(error); });
  }

  void on_read(const error_code& error) {
    if (error) return fail(error);
    HttpRequest request = parser_->release();
    if (!beast::websocket::is_upgrade(request)) {
      EdgeCounters::add(hub_.counters().requests);
      return reply(reply_to(request, hub_, is_loopback()));
    }
    if (HttpResponse refusal = refuse_upgrade(request, hub_.config()); !refusal.body().empty()) {
      return reply(std::move(refusal));
    }
    upgrade(std::move(request));
  }

  void upgrade(HttpRequest request) {
    is_finished_ = true;  // the stream moves on
    const bool watches = request.target().starts_with("/watch");
    const auto session = std::make_shared<WebSocketSession<Stream>>(hub_, std::move(stream_), *this, watches);
    const auto self = this->shared_from_this();  // the hub releases it
    hub_.add(session);
    session->start(std::move(request));
  }

  void reply(HttpResponse response) {
    has_replied_ = true;
    response_ = std::move(response);
    set_deadline(hub_.config().limits.reply_s);
    beast::http::async_write(stream_, response_,
                             [self = this->shared_from_this()](const error_code& error, std::size_t) {
                               if (error || !self->response_.keep_alive()) return self->finish();
                               self->set_deadline(self->hub_.config().limits.hello_s);
                               self->read();
                             });
  }

  /// A connection that is idle after a reply ends by itself; one that never sent a request had its time.
  void fail(const error_code& error) {
    if (error == beast::error::timeout && !has_replied_) {
      EdgeCounters::add(hub_.counters().closed[index_of(CloseCode::timeout)]);
    }
    finish();
  }

  void finish() {
    if (is_finished_) return;
    abort();
    is_finished_ = true;
    hub_.remove(*this);
  }

  Hub& hub_;
  Stream stream_;
  beast::flat_buffer received_;
  std::optional<beast::http::request_parser<beast::http::string_body>> parser_;
  HttpResponse response_;
  bool has_replied_ = false, is_finished_ = false;
};

}  // namespace ringfence::gateway
