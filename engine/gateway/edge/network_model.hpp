#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace ringfence::gateway {

/// A network that is worse than the real one, for tests: applies to both directions.
struct NetworkModel {
  double delay_s = 0;  ///< of every message
  double jitter_s =
      0;            ///< each message is delayed by up to this in addition, so messages that may be lost overtake others
  double loss = 0;  ///< share of the messages that may be lost: inputs, acknowledgements, updates; 0 to 1
  double share = 1;     ///< share of the connections to which it applies, 0 to 1
  std::string address;  ///< IPv4, of the clients to which it applies; empty: of any
  std::uint64_t seed = 1;

  bool is_perfect() const noexcept { return delay_s == 0 && jitter_s == 0 && loss == 0; }
  /// Reads "delay=150ms,jitter=50ms,loss=5%,share=50%,address=127.0.0.2"; each part at most once, in any order; empty:
  /// perfect. Throws Error that names the part.
  static NetworkModel parse(std::string_view text);
};

}  // namespace ringfence::gateway
