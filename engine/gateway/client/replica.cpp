#include "gateway/client/replica.hpp"

namespace ringfence::gateway {

Replica::Outcome Replica::apply(const Update& update) {
  const std::uint64_t frames = update.frame + 1;
  if (frames <= frames_) return Outcome::ignored;
  if (update.since == 0) {
    objects_.clear();
  } else if (update.since >= frames || frames - update.since > frames_) {
    return Outcome::ignored;
  }
  for (const ObjectNumber number : update.removed) objects_.erase(number);
  for (const EnteredObject& entered : update.entered) {
    objects_[entered.number] = {entered.generation,
                                entered.shape,
                                entered.category,
                                entered.user,
                                entered.position,
                                entered.turn,
                                {entered.metadata.begin(), entered.metadata.end()}};
  }
  bool is_valid = true;
  for (const MovedObject& moved : update.moved) {
    const auto found = objects_.find(moved.number);
    if (found == objects_.end()) {
      is_valid = false;
      continue;
    }
    found->second.position = moved.position;
    if (moved.has_turn) found->second.turn = moved.turn;
  }
  contacts_ = update.contacts;
  touching_ = update.touching;
  own_.reset();
  if (update.own) {
    const OwnState& own = *update.own;
    own_ = Own{own.number, own.shape, own.pose, {own.state.begin(), own.state.end()}};
  }
  frames_ = frames;
  return is_valid ? Outcome::applied : Outcome::invalid;
}

}  // namespace ringfence::gateway
