#include "gateway/clients/newest_input.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::gateway {

void NewestInput::receive(const Input& input, double received_s) noexcept {
  if (input.sequence <= received_) return;
  received_ = input.sequence;
  received_s_ = received_s;
  echo_ = input.time;
  size_ = input.body.size();
  std::ranges::copy(input.body, bytes_.begin());
}

Status NewestInput::apply(World& world, UserId user, ObjectId avatar, Stamp next) {
  if (size_ > 0) {
    const Status status = world.input(user, avatar, std::span(bytes_).first(size_));
    if (status != Status::ok) return status;
  }
  if (applied_ != received_) {
    applied_ = received_;
    applied_at_ = next;
  }
  return Status::ok;
}

void NewestInput::acknowledge(Stamp now, double now_s, Update& update) const noexcept {
  update.sequence = applied_;
  update.age = applied_ == 0 ? 0 : now - applied_at_;
  update.echo = echo_;
  update.hold_ms = received_ == 0 ? 0 : static_cast<std::uint64_t>(std::max(0.0, (now_s - received_s_) * 1e3));
}

}  // namespace ringfence::gateway
