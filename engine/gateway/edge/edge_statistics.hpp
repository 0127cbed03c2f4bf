#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// All reasons to close a connection.
inline constexpr std::array close_codes{
    CloseCode::going_away, CloseCode::text,    CloseCode::too_big,  CloseCode::malformed, CloseCode::unauthorised,
    CloseCode::forbidden,  CloseCode::timeout, CloseCode::replaced, CloseCode::too_many,  CloseCode::full};
constexpr std::size_t index_of(CloseCode code) noexcept {
  std::size_t index = 0;
  while (index + 1 < close_codes.size() && close_codes[index] != code) ++index;
  return index;
}

/// Work of an Edge since its construction.
struct EdgeStatistics {
  std::uint64_t connections = 0;  ///< accepted
  std::uint64_t open = 0;         ///< now
  std::uint64_t admitted = 0;     ///< now
  std::uint64_t received_messages = 0, received_bytes = 0;
  std::uint64_t sent_messages = 0, sent_bytes = 0;
  std::uint64_t replaced = 0;                              ///< updates that a newer one replaced before they were sent
  std::uint64_t requests = 0;                              ///< of HTTP, without those for a WebSocket
  std::array<std::uint64_t, close_codes.size()> closed{};  ///< by the gateway, by close_codes
  double cpu_s = 0;                                        ///< CPU time of the thread
};

/// The same while the thread counts. Written by that thread, read by any.
struct EdgeCounters {
  using Counter = std::atomic<std::uint64_t>;
  Counter connections{0}, open{0}, admitted{0}, received_messages{0}, received_bytes{0}, sent_messages{0},
      sent_bytes{0}, replaced{0}, requests{0};
  std::array<Counter, close_codes.size()> closed{};

  /// Only the thread of the edge writes, so that an addition does not need to be atomic.
  static void add(Counter& counter, std::uint64_t value = 1) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + value, std::memory_order_relaxed);
  }
};

}  // namespace ringfence::gateway
