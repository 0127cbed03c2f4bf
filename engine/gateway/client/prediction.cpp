#include "gateway/client/prediction.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace ringfence::gateway {
namespace {

constexpr std::size_t max_ticks = 200;
constexpr double avatar_reach = 5;  // metres from the avatar's position: its size, and how far it gets while ticks wait

}  // namespace

void Prediction::tick(std::uint64_t sequence, std::span<const std::byte> input) {
  const bool is_same = !ticks_.empty() && ticks_.back().sequence == sequence;
  Tick tick;
  tick.sequence = sequence;
  tick.age = is_same ? ticks_.back().age + 1 : sequence == done_sequence_ ? done_age_ + 1 : 0;
  tick.input_size = std::min(input.size(), max_input_bytes);
  std::copy_n(input.begin(), tick.input_size, tick.input.begin());
  if (has_avatar_) step(tick);
  ticks_.push_back(tick);
  if (ticks_.size() > max_ticks) ticks_.pop_front();
}

std::optional<Vec3d> Prediction::remove_done(const Update& update) {
  std::optional<Vec3d> predicted;
  while (!ticks_.empty()) {
    const Tick& tick = ticks_.front();
    if (tick.sequence > update.sequence || (tick.sequence == update.sequence && tick.age > update.age)) break;
    if (tick.sequence == update.sequence && tick.age == update.age) predicted = tick.position;
    done_sequence_ = tick.sequence;
    done_age_ = tick.age;
    ticks_.pop_front();
  }
  return predicted;
}

std::optional<double> Prediction::reconcile(const Update& update, const Replica& replica) {
  const bool was_predicted = has_avatar_;
  const std::optional<Vec3d> predicted = remove_done(update);
  has_avatar_ = replica.own().has_value();
  if (!has_avatar_) return std::nullopt;
  const Replica::Own& own = *replica.own();
  number_ = own.number;
  shape_ = own.shape;
  pose_ = own.pose;
  frame_ = update.frame;
  state_ = {};
  std::copy_n(own.state.begin(), std::min(own.state.size(), state_.size()), state_.begin());
  obstacles_.select(replica, pose_.position, avatar_reach);
  obstacles_.read(replica, number_, contacts_);
  for (Tick& tick : ticks_) step(tick);
  if (!was_predicted || !predicted) return std::nullopt;
  const Vec3d& found = own.pose.position;
  return std::hypot(predicted->x - found.x, predicted->y - found.y, predicted->z - found.z);
}

void Prediction::step(Tick& tick) {
  indices_.resize(contacts_.size());
  std::iota(indices_.begin(), indices_.end(), 0u);
  MotionInput input;
  input.number = number_;
  input.shape = shape_;
  input.category = Category::avatar;
  input.pose = pose_;
  input.state = state_.data();
  input.contacts = ObjectContacts(contacts_.data(), indices_);
  input.input = std::span(tick.input).first(tick.input_size);
  alignas(8) std::array<std::byte, max_motion_state> state = state_;
  MotionOutput output;
  output.pose = pose_;
  output.state = state.data();
  model_.move(++frame_, {&input, 1}, {&output, 1});
  pose_ = output.pose;
  state_ = state;
  tick.position = pose_.position;
  obstacles_.find(number_, shape_, pose_, contacts_);
}

}  // namespace ringfence::gateway
