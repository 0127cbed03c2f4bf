#include "gateway/client/web_client.hpp"

#include <deque>
#include <optional>
#include <type_traits>
#include <utility>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <openssl/ssl.h>

#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

template <class Stream>
class WebClientOf final : public WebClient, public std::enable_shared_from_this<WebClientOf<Stream>> {
 public:
  template <class... Arguments>
  WebClientOf(net::io_context& io, const GatewayUrl& url, std::string path, Handlers handlers,
              std::optional<net::ip::address> from, Arguments&&... arguments)
      : resolver_(io.get_executor()),
        socket_(io.get_executor(), std::forward<Arguments>(arguments)...),
        url_(url),
        path_(std::move(path)),
        handlers_(std::move(handlers)),
        from_(std::move(from)) {}

  void start() {
    resolver_.async_resolve(url_.host, url_.port,
                            [self = this->shared_from_this()](const error_code& error, const auto& found) {
                              if (error) return self->finish(error);
                              self->connect(found);
                            });
  }

  void send(std::vector<std::byte> message) override {
    waiting_.push_back(std::move(message));
    if (is_open_ && !is_writing_) write();
  }

  void close() override {
    if (!is_open_) return beast::get_lowest_layer(socket_).close();
    socket_.async_close(beast::websocket::close_code::normal, [self = this->shared_from_this()](const error_code&) {});
  }

  void stop_reading() noexcept override { reads_ = false; }

 private:
  using Resolver = net::ip::basic_resolver<Tcp, Executor>;

  void connect(const typename Resolver::results_type& found) {
    if (from_) return connect_from(*found.begin());
    beast::get_lowest_layer(socket_).async_connect(
        found, [self = this->shared_from_this()](const error_code& error, const Tcp::endpoint&) {
          if (error) return self->finish(error);
          self->handshake();
        });
  }

  /// A socket that is bound can try one address only.
  void connect_from(const Tcp::endpoint& to) {
    error_code error;
    auto& socket = beast::get_lowest_layer(socket_).socket();
    socket.open(from_->is_v6() ? Tcp::v6() : Tcp::v4(), error);
    if (!error) socket.bind({*from_, 0}, error);
    if (error) return finish(error);
    beast::get_lowest_layer(socket_).async_connect(to, [self = this->shared_from_this()](const error_code& failure) {
      if (failure) return self->finish(failure);
      self->handshake();
    });
  }

  void handshake() {
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().set_option(Tcp::no_delay(true), ignored);
    if constexpr (std::is_same_v<Stream, TlsStream>) {
      SSL_set_tlsext_host_name(socket_.next_layer().native_handle(), url_.host.c_str());
      socket_.next_layer().async_handshake(net::ssl::stream_base::client,
                                           [self = this->shared_from_this()](const error_code& error) {
                                             if (error) return self->finish(error);
                                             self->upgrade();
                                           });
    } else {
      upgrade();
    }
  }

  void upgrade() {
    socket_.binary(true);
    socket_.auto_fragment(false);
    socket_.read_message_max(std::size_t{64} << 20);
    socket_.async_handshake(url_.host + ":" + url_.port, path_,
                            [self = this->shared_from_this()](const error_code& error) {
                              if (error) return self->finish(error);
                              self->is_open_ = true;
                              self->handlers_.opened();
                              if (!self->waiting_.empty() && !self->is_writing_) self->write();
                              self->read();
                            });
  }

  void read() {
    if (!reads_) return;
    socket_.async_read(received_, [self = this->shared_from_this()](const error_code& error, std::size_t) {
      if (error) return self->finish(error);
      const auto data = self->received_.data();
      self->handlers_.message({static_cast<const std::byte*>(data.data()), data.size()});
      self->received_.consume(self->received_.size());
      self->read();
    });
  }

  void write() {
    is_writing_ = true;
    socket_.async_write(net::buffer(waiting_.front().data(), waiting_.front().size()),
                        [self = this->shared_from_this()](const error_code& error, std::size_t) {
                          self->is_writing_ = false;
                          if (error) return;  // the read that waits ends the connection
                          self->waiting_.pop_front();
                          if (!self->waiting_.empty()) self->write();
                        });
  }

  void finish(const error_code& error) {
    if (std::exchange(is_finished_, true)) return;
    is_open_ = false;
    const auto& reason = socket_.reason();
    const bool has_code = error == beast::websocket::error::closed;
    handlers_.closed(has_code ? static_cast<std::uint16_t>(reason.code) : std::uint16_t{0},
                     has_code ? std::string(reason.reason.data(), reason.reason.size()) : error.message());
    handlers_ = {[] {}, [](std::span<const std::byte>) {}, [](std::uint16_t, const std::string&) {}};
  }

  Resolver resolver_;
  beast::websocket::stream<Stream> socket_;
  GatewayUrl url_;
  std::string path_;
  Handlers handlers_;
  std::optional<net::ip::address> from_;
  beast::flat_buffer received_;
  std::deque<std::vector<std::byte>> waiting_;  ///< the first is being written if is_writing_
  bool is_open_ = false, is_writing_ = false, is_finished_ = false, reads_ = true;
};

std::optional<net::ip::address> read_address(const std::string& text) {
  if (text.empty()) return std::nullopt;
  error_code error;
  const auto address = net::ip::make_address(text, error);
  if (error) throw Error("from: found " + text + "; expected an IP address of this machine such as 127.0.0.2");
  return address;
}

}  // namespace

GatewayUrl GatewayUrl::parse(const std::string& text) {
  const auto fail = [&]() -> GatewayUrl {
    throw Error("url: found " + text + "; expected http://HOST:PORT or https://HOST:PORT");
  };
  GatewayUrl url;
  const std::size_t scheme_end = text.find("://");
  if (scheme_end == std::string::npos) return fail();
  const std::string scheme = text.substr(0, scheme_end);
  url.uses_tls = scheme == "https" || scheme == "wss";
  if (!url.uses_tls && scheme != "http" && scheme != "ws") return fail();
  std::string rest = text.substr(scheme_end + 3);
  if (rest.ends_with('/')) rest.pop_back();
  const std::size_t colon = rest.rfind(':');
  const bool has_port = colon != std::string::npos && !rest.ends_with(']');
  url.host = has_port ? rest.substr(0, colon) : rest;
  url.port = has_port ? rest.substr(colon + 1) : url.uses_tls ? "443" : "80";
  if (url.host.starts_with('[') && url.host.ends_with(']')) url.host = url.host.substr(1, url.host.size() - 2);
  if (url.host.empty() || url.port.empty() || url.port.find_first_not_of("0123456789") != std::string::npos) {
    return fail();
  }
  return url;
}

std::shared_ptr<WebClient> WebClient::connect(net::io_context& io, const GatewayUrl& url, const std::string& path,
                                              net::ssl::context* tls, Handlers handlers, const std::string& from) {
  const std::optional<net::ip::address> address = read_address(from);
  if (url.uses_tls) {
    auto client = std::make_shared<WebClientOf<TlsStream>>(io, url, path, std::move(handlers), address, *tls);
    client->start();
    return client;
  }
  auto client = std::make_shared<WebClientOf<PlainStream>>(io, url, path, std::move(handlers), address);
  client->start();
  return client;
}

}  // namespace ringfence::gateway
