#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gateway/edge/network_model.hpp"

namespace ringfence::gateway {

/// Limits that protect the gateway from clients. Times in seconds. Gateway raises the limits of messages where its
/// frames are short.
struct EdgeLimits {
  double hello_s = 5;                        ///< for the TLS handshake, for each request of HTTP, and for the hello
  double reply_s = 60;                       ///< for a reply of HTTP, and for a connection without a hello in all
  double slow_reader_s = 10;                 ///< without any progress of a write
  double idle_s = 30;                        ///< without any message; pings are sent after half of it
  double messages_per_s = 120;               ///< of a connection, in the long run
  double message_burst = 240;                ///< of a connection, at once
  std::size_t waiting_bytes = 1u << 20;      ///< of reliable messages that a client has not read
  std::size_t send_buffer = 128u << 10;      ///< of the system, for each connection
  std::size_t not_admitted = 1024;           ///< connections without a hello; of more, the oldest are closed
  std::size_t connections_per_address = 64;  ///< loopback addresses excepted
  double wrong_tokens_per_s = 5;             ///< from one address, in the long run
  double wrong_token_burst = 20;             ///< from one address, at once
};

/// Configuration of an Edge.
struct EdgeConfig {
  std::string host = "127.0.0.1";
  std::uint16_t port = 8080;               ///< 0: any free port
  std::string certificate_file, key_file;  ///< PEM; both or none
  std::string token_key;                   ///< empty: guests only
  std::string world = "ringfence";         ///< `aud` of tokens
  std::size_t max_clients = 10000;         ///< admitted connections
  bool serves_clients = true;              ///< false: only /metrics and /healthz, and only for this machine
  std::vector<std::string> origins;        ///< empty: that of the Host header only
  std::string page_directory;              ///< empty: no page
  EdgeLimits limits;
  NetworkModel network;
};

}  // namespace ringfence::gateway
