#pragma once

#include <cstddef>
#include <string>
#include <unordered_map>

#include "gateway/edge/edge_config.hpp"

namespace ringfence::gateway {

/// An allowance that refills with time and can be saved up to a limit.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) noexcept : per_second_(per_second), burst_(burst), left_(burst) {}
  /// Takes one; false if nothing is left. `now_s`: seconds of a steady clock.
  bool take(double now_s) noexcept;
  /// Whether nothing was taken for so long that it is full.
  bool is_full(double now_s) const noexcept { return left_ + (now_s - last_s_) * per_second_ >= burst_; }

 private:
  double per_second_, burst_, left_;
  double last_s_ = 0;
};

/// What one address may do: open connections, and send wrong tokens. There are no limits for loopback addresses, since
/// all clients behind a proxy on this machine have one.
///
/// Threads: one. Memory: 100 bytes for each address that is connected or sent a wrong token in the last seconds.
class AddressLimits {
 public:
  explicit AddressLimits(const EdgeLimits& limits) : limits_(limits) {}

  /// Counts a new connection; false if there are too many, then it is not counted.
  bool open(const std::string& address, bool is_loopback);
  void close(const std::string& address);
  /// Whether the address may try a token now. Tokens that are right do not count.
  bool may_try(const std::string& address, bool is_loopback, double now_s);
  void add_wrong_token(const std::string& address, double now_s);
  /// Forgets addresses that are not needed. Call it from time to time.
  void clean(double now_s);
  std::size_t size() const noexcept { return addresses_.size(); }

 private:
  struct Address {
    std::size_t connections = 0;
    TokenBucket tries;
    bool is_blocked = false;  ///< until the allowance of wrong tokens is full again
  };
  Address& of(const std::string& address);

  EdgeLimits limits_;
  std::unordered_map<std::string, Address> addresses_;
};

}  // namespace ringfence::gateway
