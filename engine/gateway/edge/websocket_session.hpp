#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <boost/beast/websocket/stream.hpp>

#include "gateway/edge/asio.hpp"
#include "gateway/edge/hub.hpp"
#include "gateway/edge/peer.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::gateway {

/// A connection after its upgrade to a WebSocket. At most one message is being written; while it is, a newer update
/// replaces the one that waits.
template <class Stream>
class WebSocketSession final : public Peer, public std::enable_shared_from_this<WebSocketSession<Stream>> {
 public:
  using Request = beast::http::request<beast::http::string_body>;

  /// Takes over the connection of `before`.
  WebSocketSession(Hub& hub, Stream&& stream, const Peer& before, bool watches)
      : Peer(before.id(), before.address(), before.is_loopback(), telemetry::now_s() + hub.config().limits.hello_s),
        hub_(hub),
        socket_(std::in_place, std::move(stream)),
        allowance_(hub.config().limits.messages_per_s, hub.config().limits.message_burst),
        watches_(watches) {}

  void start(Request request) {
    namespace websocket = beast::websocket;
    const EdgeLimits& limits = hub_.config().limits;
    beast::get_lowest_layer(*socket_).expires_never();
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = seconds(limits.hello_s);
    timeout.idle_timeout = seconds(limits.idle_s);
    timeout.keep_alive_pings = true;
    socket_->set_option(timeout);
    // on_read() has the limit. Beast would close the socket while bytes of the message are unread, and the reset that
    // follows may reach the client before the close code.
    socket_->read_message_max(0);
    socket_->auto_fragment(false);
    socket_->binary(true);
    socket_->control_callback([this](websocket::frame_type kind, boost::beast::string_view) {
      if (kind == websocket::frame_type::ping) take_ping();
    });
    request_ = std::move(request);
    socket_->async_accept(request_, [self = this->shared_from_this()](const error_code& error) {
      if (error) return self->finish();
      self->request_ = {};
      self->read();
    });
  }

  void send(Delivery delivery, std::span<const std::byte> message) override {
    if (closing_s_ != 0) return;
    if (delivery == Delivery::newest) {
      if (has_update_) EdgeCounters::add(hub_.counters().replaced);
      update_.assign(message.begin(), message.end());
      has_update_ = true;
    } else {
      waiting_bytes_ += message.size();
      if (waiting_bytes_ > hub_.config().limits.waiting_bytes) {
        return hub_.refuse(*this, CloseCode::timeout, "too many messages wait to be read");
      }
      reliable_.emplace_back(message.begin(), message.end());
    }
    if (writing_s_ == 0) write();
  }

  void close(CloseCode code, const std::string& reason) override {
    if (closing_s_ != 0 || is_finished_) return;
    closing_s_ = telemetry::now_s();
    constexpr std::size_t max_reason = 123;
    reason_ =
        beast::websocket::close_reason(static_cast<beast::websocket::close_code>(code), reason.substr(0, max_reason));
    if (writing_s_ == 0) write();
  }

  /// Ends the session also if no operation of the socket will complete: in Beast 1.74 an operation that reads an
  /// invalid frame and one that closes can wait for each other for ever. They belong to the stream, so it is deleted.
  void abort() noexcept override {
    if (!socket_) return;
    beast::get_lowest_layer(*socket_).close();
    net::post(socket_->get_executor(), [self = this->shared_from_this()] {
      self->finish();
      self->socket_.reset();
    });
  }
  double stalled_since() const noexcept override { return writing_s_; }
  double closing_since() const noexcept override { return closing_s_; }

 private:
  static std::chrono::nanoseconds seconds(double value) {
    return std::chrono::nanoseconds(static_cast<std::int64_t>(value * 1e9));
  }

  /// Reads a part of a message, at most one byte more than it may have.
  void read() {
    socket_->async_read_some(
        received_, max_client_message + 1 - received_.size(),
        [self = this->shared_from_this()](const error_code& error, std::size_t) { self->on_read(error); });
  }

  void on_read(const error_code& error) {
    if (error || is_finished_) return finish();
    const bool is_too_big = received_.size() > max_client_message;
    if (closing_s_ == 0 && is_too_big) {
      hub_.refuse(*this, CloseCode::too_big,
                  "expected messages of at most " + std::to_string(max_client_message) + " bytes");
    } else if (closing_s_ == 0 && socket_->is_message_done()) {
      take_message();
    } else if (closing_s_ == 0 && !allowance_.take(telemetry::now_s())) {
      refuse_flood();  // a message in many fragments costs as much as many messages
    }
    // From now on, the operation that closes reads.
    if (closing_s_ != 0) return;
    if (socket_->is_message_done()) received_.consume(received_.size());
    read();
  }

  /// Each ping is answered, so it costs as much as a message and counts as one.
  void take_ping() {
    if (closing_s_ != 0 || allowance_.take(telemetry::now_s())) return;
    // It is called in the middle of a read.
    net::post(socket_->get_executor(), [self = this->shared_from_this()] {
      if (self->closing_s_ == 0) self->refuse_flood();
    });
  }

  void refuse_flood() {
    hub_.refuse(*this, CloseCode::too_many, "too many messages per second; connect again after a second");
  }

  void take_message() {
    const auto data = received_.data();
    const std::span<const std::byte> message(static_cast<const std::byte*>(data.data()), data.size());
    EdgeCounters::add(hub_.counters().received_messages);
    EdgeCounters::add(hub_.counters().received_bytes, message.size());
    if (socket_->got_text()) return hub_.refuse(*this, CloseCode::text, "expected binary messages");
    if (!is_admitted()) return hub_.admit(*this, watches_, message);
    if (!allowance_.take(telemetry::now_s())) return refuse_flood();
    hub_.receive(*this, message);
  }

  void write() {
    if (!reliable_.empty()) {
      written_ = std::move(reliable_.front());
      waiting_bytes_ -= written_.size();
      reliable_.pop_front();
    } else if (has_update_ && closing_s_ == 0) {
      std::swap(written_, update_);
      has_update_ = false;
    } else {
      if (closing_s_ != 0) send_close();
      return;
    }
    writing_s_ = telemetry::now_s();
    socket_->async_write(net::buffer(written_.data(), written_.size()),
                         [self = this->shared_from_this()](const error_code& error, std::size_t bytes) {
                           self->on_written(error, bytes);
                         });
  }

  void on_written(const error_code& error, std::size_t bytes) {
    writing_s_ = 0;
    if (error || is_finished_) return finish();
    EdgeCounters::add(hub_.counters().sent_messages);
    EdgeCounters::add(hub_.counters().sent_bytes, bytes);
    write();
  }

  void send_close() {
    if (std::exchange(is_close_sent_, true)) return;
    socket_->async_close(reason_, [self = this->shared_from_this()](const error_code&) { self->finish(); });
  }

  void finish() {
    if (std::exchange(is_finished_, true)) return;
    abort();
    hub_.remove(*this);
  }

  Hub& hub_;
  std::optional<beast::websocket::stream<Stream>> socket_;  ///< until the session was aborted
  Request request_;                                         ///< until it is accepted
  beast::flat_buffer received_;
  TokenBucket allowance_;
  bool watches_;
  std::deque<std::vector<std::byte>> reliable_;
  std::size_t waiting_bytes_ = 0;   ///< of reliable_
  std::vector<std::byte> update_;   ///< waits if has_update_
  std::vector<std::byte> written_;  ///< is being written if writing_s_ is not 0
  bool has_update_ = false, is_close_sent_ = false, is_finished_ = false;
  double writing_s_ = 0, closing_s_ = 0;
  beast::websocket::close_reason reason_;
};

}  // namespace ringfence::gateway
