#include "gateway/edge/address_limits.hpp"

#include <algorithm>

namespace ringfence::gateway {

bool TokenBucket::take(double now_s) noexcept {
  if (last_s_ != 0) left_ = std::min(burst_, left_ + (now_s - last_s_) * per_second_);
  last_s_ = now_s;
  if (left_ < 1) return false;
  left_ -= 1;
  return true;
}

AddressLimits::Address& AddressLimits::of(const std::string& address) {
  const auto found = addresses_.find(address);
  if (found != addresses_.end()) return found->second;
  Address fresh{0, TokenBucket(limits_.wrong_tokens_per_s, limits_.wrong_token_burst)};
  return addresses_.emplace(address, fresh).first->second;
}

bool AddressLimits::open(const std::string& address, bool is_loopback) {
  Address& entry = of(address);
  if (!is_loopback && entry.connections >= limits_.connections_per_address) return false;
  ++entry.connections;
  return true;
}

void AddressLimits::close(const std::string& address) { --of(address).connections; }

bool AddressLimits::may_try(const std::string& address, bool is_loopback, double now_s) {
  if (is_loopback) return true;
  Address& entry = of(address);
  if (entry.is_blocked && entry.tries.is_full(now_s)) entry.is_blocked = false;
  return !entry.is_blocked;
}

void AddressLimits::add_wrong_token(const std::string& address, double now_s) {
  Address& entry = of(address);
  if (!entry.tries.take(now_s)) entry.is_blocked = true;
}

void AddressLimits::clean(double now_s) {
  std::erase_if(addresses_,
                [&](const auto& each) { return each.second.connections == 0 && each.second.tries.is_full(now_s); });
}

}  // namespace ringfence::gateway
