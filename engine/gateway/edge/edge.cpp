#include "gateway/edge/edge.hpp"

#include <chrono>
#include <ctime>
#include <memory>
#include <thread>
#include <utility>

#include <boost/asio/ip/network_v6.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/socket_base.hpp>
#include <pthread.h>

#include "gateway/edge/asio.hpp"
#include "gateway/edge/http_session.hpp"
#include "gateway/edge/hub.hpp"
#include "gateway/edge/tls.hpp"
#include "ringfence/error.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::gateway {
namespace {

net::ip::address address_of(const EdgeConfig& config) {
  error_code error;
  auto address = net::ip::make_address(config.host == "localhost" ? "127.0.0.1" : config.host, error);
  if (error) throw Error("listen: found " + config.host + "; expected an IP address such as 127.0.0.1 or 0.0.0.0");
  return address;
}

/// What limits for an address count: of IPv6 the network of 64 bits, since a host has all addresses in it.
std::string counted_address(const net::ip::address& address) {
  if (address.is_v4()) return address.to_string();
  if (address.to_v6().is_v4_mapped()) {
    return net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6()).to_string();
  }
  return net::ip::make_network_v6(address.to_v6(), 64).canonical().to_string();
}

/// Only this machine may connect without encryption and without tokens.
void check_protection(const EdgeConfig& config, const net::ip::address& address) {
  if (config.certificate_file.empty() != config.key_file.empty()) {
    throw Error("TLS needs both a certificate and its key");
  }
  if (address.is_loopback()) return;
  if (!config.serves_clients) {
    throw Error("metrics: " + config.host + " is open to other machines: listen at 127.0.0.1 behind a proxy");
  }
  if (config.certificate_file.empty()) {
    throw Error("listen: " + config.host +
                " is open to other machines: give a certificate and its key, or listen at 127.0.0.1 behind a proxy");
  }
  if (config.token_key.empty()) {
    throw Error("listen: " + config.host + " is open to other machines: give a key for tokens");
  }
}

}  // namespace

struct Edge::Implementation {
  using Socket = net::basic_stream_socket<Tcp, Executor>;

  explicit Implementation(const EdgeConfig& config)
      : hub(io, config), tls(make_tls(config)), acceptor(io), retry_timer(io.get_executor()) {
    const net::ip::address address = address_of(config);
    check_protection(config, address);
    listen({address, config.port});
    const std::string host = address.is_v6() ? "[" + config.host + "]" : config.host;
    url = (tls ? "https://" : "http://") + host + ":" + std::to_string(acceptor.local_endpoint().port());
    accept();
    thread = std::thread([this] { io.run(); });
  }

  void listen(const Tcp::endpoint& endpoint) {
    error_code error;
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(net::socket_base::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
    if (error) {
      throw Error("cannot listen at " + endpoint.address().to_string() + ":" + std::to_string(endpoint.port()) + ": " +
                  error.message() + "; choose another port");
    }
  }

  void accept() {
    acceptor.async_accept([this](const error_code& error, Socket socket) {
      if (error == net::error::operation_aborted || !acceptor.is_open()) return;
      if (error) return accept_later();
      begin(std::move(socket));
      accept();
    });
  }

  /// Without free file descriptors each attempt would fail at once.
  void accept_later() {
    retry_timer.expires_after(std::chrono::milliseconds(100));
    retry_timer.async_wait([this](const error_code& error) {
      if (!error) accept();
    });
  }

  void begin(Socket socket) {
    error_code error;
    const Tcp::endpoint remote = socket.remote_endpoint(error);
    if (error) return;
    const std::string address = counted_address(remote.address());
    const bool is_loopback = remote.address().is_loopback();
    if (!hub.open_address(address, is_loopback)) {
      EdgeCounters::add(hub.counters().closed[index_of(CloseCode::too_many)]);
      return;
    }
    socket.set_option(Tcp::no_delay(true), error);
    socket.set_option(net::socket_base::send_buffer_size(static_cast<int>(hub.config().limits.send_buffer)), error);
    const double deadline_s = telemetry::now_s() + hub.config().limits.reply_s;
    const auto start = [&]<class Stream>(Stream&& stream) {
      const auto session = std::make_shared<HttpSession<Stream>>(hub, std::forward<Stream>(stream), hub.next_id(),
                                                                 address, is_loopback, deadline_s);
      hub.add(session);
      session->start();
    };
    if (tls) {
      start(TlsStream(PlainStream(std::move(socket)), *tls));
    } else {
      start(PlainStream(std::move(socket)));
    }
  }

  net::io_context io{1};
  Hub hub;
  std::unique_ptr<net::ssl::context> tls;  ///< null: plain text
  net::basic_socket_acceptor<Tcp, Executor> acceptor;
  Timer retry_timer;
  std::string url;
  std::thread thread;
};

Edge::Edge(const EdgeConfig& config) : implementation_(std::make_unique<Implementation>(config)) {}

Edge::~Edge() {
  Implementation& self = *implementation_;
  net::post(self.io, [&self] {
    error_code ignored;
    self.acceptor.close(ignored);
    self.retry_timer.cancel();
    self.hub.abort_all();
    // What is left are completions of aborted operations.
    net::post(self.io, [&self] { self.io.stop(); });
  });
  self.thread.join();
}

const std::string& Edge::url() const noexcept { return implementation_->url; }

std::string Edge::guest_token(UserId user) const {
  return implementation_->hub.admission().guest_token(user, std::time(nullptr));
}

EdgeStatistics Edge::statistics() const {
  const EdgeCounters& counters = implementation_->hub.counters();
  const auto value = [](const EdgeCounters::Counter& counter) { return counter.load(std::memory_order_relaxed); };
  EdgeStatistics statistics;
  statistics.connections = value(counters.connections);
  statistics.open = value(counters.open);
  statistics.admitted = value(counters.admitted);
  statistics.received_messages = value(counters.received_messages);
  statistics.received_bytes = value(counters.received_bytes);
  statistics.sent_messages = value(counters.sent_messages);
  statistics.sent_bytes = value(counters.sent_bytes);
  statistics.replaced = value(counters.replaced);
  statistics.requests = value(counters.requests);
  for (std::size_t i = 0; i < close_codes.size(); ++i) statistics.closed[i] = value(counters.closed[i]);
  clockid_t clock{};
  timespec time{};
  if (pthread_getcpuclockid(implementation_->thread.native_handle(), &clock) == 0 && clock_gettime(clock, &time) == 0) {
    statistics.cpu_s = static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
  }
  return statistics;
}

void Edge::stop_accepting() {
  net::post(implementation_->io, [self = implementation_.get()] {
    error_code ignored;
    self->acceptor.close(ignored);
    self->retry_timer.cancel();
  });
}

bool Edge::wait_until_empty(double seconds) { return implementation_->hub.wait_until_empty(seconds); }

void Edge::receive(Inbox& inbox) { implementation_->hub.take(inbox); }
void Edge::send(Outbox& outbox) { implementation_->hub.send(outbox); }
void Edge::set_metrics(std::string_view text) { implementation_->hub.set_metrics(text); }

}  // namespace ringfence::gateway
