#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gateway/edge/asio.hpp"

namespace ringfence::gateway {

/// The address of a gateway: "http://HOST:PORT", or "https", "ws" or "wss".
struct GatewayUrl {
  bool uses_tls = false;
  std::string host;
  std::string port;
  /// Throws Error, which says what is expected.
  static GatewayUrl parse(const std::string& text);
};

/// A WebSocket of a client. The functions and handlers run on the thread that runs `io`.
class WebClient {
 public:
  struct Handlers {
    std::function<void()> opened;
    std::function<void(std::span<const std::byte>)> message;
    /// The connection has ended, or was never made: the close code, 0 without one, and the reason. Called once.
    std::function<void(std::uint16_t, std::string)> closed;
  };
  /// Begins to connect. `path`: "/play" or "/watch". `tls`: null unless the url uses TLS; outlives the client. `from`:
  /// IP address of this machine from which it connects; empty: the system chooses. Throws Error if that is no address.
  static std::shared_ptr<WebClient> connect(net::io_context& io, const GatewayUrl& url, const std::string& path,
                                            net::ssl::context* tls, Handlers handlers, const std::string& from = {});
  virtual ~WebClient() = default;
  /// Sends a message after those before.
  virtual void send(std::vector<std::byte> message) = 0;
  /// Closes in order.
  virtual void close() = 0;
  /// Stops reading, as a client that is slow, or has failed.
  virtual void stop_reading() noexcept = 0;
};

}  // namespace ringfence::gateway
