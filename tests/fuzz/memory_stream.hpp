#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/role.hpp>
#include <boost/beast/core/stream_traits.hpp>

#include "gateway/edge/asio.hpp"

namespace ringfence::fuzz {

/// A TCP connection in memory: what the client sends is given to `receive`, what the gateway sends is in `sent`.
/// Everything completes in the io_context, as with a socket.
class Wire {
 public:
  explicit Wire(gateway::Executor executor) : executor_(std::move(executor)) {}

  /// The client sends bytes.
  void receive(std::span<const std::uint8_t> bytes) {
    waiting_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    complete();
  }
  /// The client closes the connection.
  void end() {
    has_ended_ = true;
    complete();
  }
  /// The gateway closes the connection.
  void close() noexcept {
    is_closed_ = true;
    if (read_) post(std::move(read_), gateway::net::error::operation_aborted, 0);
  }
  bool is_closed() const noexcept { return is_closed_; }
  gateway::Executor executor() const noexcept { return executor_; }

  template <class Buffers, class Handler>
  void read(const Buffers& buffers, Handler&& handler) {
    read_ = std::make_unique<ReadOf<Buffers, std::decay_t<Handler>>>(buffers, std::forward<Handler>(handler));
    complete();
  }
  template <class Buffers>
  std::size_t write(const Buffers& buffers) {
    const std::size_t before = sent.size(), size = gateway::beast::buffer_bytes(buffers);
    sent.resize(before + size);
    gateway::net::buffer_copy(gateway::net::buffer(sent.data() + before, size), buffers);
    return size;
  }

  std::string sent;

 private:
  /// A read that waits.
  struct Read {
    virtual ~Read() = default;
    virtual std::size_t fill(const std::string& bytes) = 0;
    virtual void call(const gateway::error_code& error, std::size_t size) = 0;
  };
  template <class Buffers, class Handler>
  struct ReadOf final : Read {
    ReadOf(const Buffers& to, Handler&& after) : buffers(to), handler(std::move(after)) {}
    std::size_t fill(const std::string& bytes) override {
      return gateway::net::buffer_copy(buffers, gateway::net::buffer(bytes.data(), bytes.size()));
    }
    void call(const gateway::error_code& error, std::size_t size) override { std::move(handler)(error, size); }
    Buffers buffers;
    Handler handler;
  };

  void post(std::unique_ptr<Read> read, const gateway::error_code& error, std::size_t size) {
    gateway::net::post(executor_, [read = std::move(read), error, size] { read->call(error, size); });
  }

  void complete() {
    if (!read_) return;
    if (is_closed_) return post(std::move(read_), gateway::net::error::operation_aborted, 0);
    if (!waiting_.empty()) {
      const std::size_t size = read_->fill(waiting_);
      waiting_.erase(0, size);
      return post(std::move(read_), {}, size);
    }
    if (has_ended_) post(std::move(read_), gateway::net::error::eof, 0);
  }

  gateway::Executor executor_;
  std::string waiting_;
  std::unique_ptr<Read> read_;
  bool has_ended_ = false, is_closed_ = false;
};

/// The stream of a Wire, as HttpSession and WebSocketSession use one. It has no deadlines.
class MemoryStream {
 public:
  using executor_type = gateway::Executor;

  explicit MemoryStream(std::shared_ptr<Wire> wire) : wire_(std::move(wire)) {}
  executor_type get_executor() const noexcept { return wire_->executor(); }

  template <class Buffers, class Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    wire_->read(buffers, std::forward<Handler>(handler));
  }
  template <class Buffers, class Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    gateway::error_code error;
    std::size_t size = 0;
    if (wire_->is_closed()) {
      error = gateway::net::error::operation_aborted;
    } else {
      size = wire_->write(buffers);
    }
    gateway::net::post(get_executor(), [handler = std::forward<Handler>(handler), error, size]() mutable {
      std::move(handler)(error, size);
    });
  }

  void expires_after(std::chrono::nanoseconds) noexcept {}
  void expires_never() noexcept {}
  void close() noexcept { wire_->close(); }

 private:
  std::shared_ptr<Wire> wire_;
};

inline void beast_close_socket(MemoryStream& stream) { stream.close(); }
inline void teardown(gateway::beast::role_type, MemoryStream& stream, gateway::error_code& error) {
  error = {};
  stream.close();
}
template <class Handler>
void async_teardown(gateway::beast::role_type, MemoryStream& stream, Handler&& handler) {
  stream.close();
  gateway::net::post(stream.get_executor(), [handler = std::forward<Handler>(handler)]() mutable {
    std::move(handler)(gateway::error_code());
  });
}

}  // namespace ringfence::fuzz
