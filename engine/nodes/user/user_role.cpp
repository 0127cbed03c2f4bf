#include "nodes/user/user_role.hpp"

#include <algorithm>
#include <cstring>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

UserRole::UserRole(const UserSetup& setup)
    : user_(setup.user), host_(setup.model, setup.objects, &fault_, true), fault_(setup.faults) {
  host_.sense(setup.sense);
}

void UserRole::move(std::uint64_t frame, MoveScratch& scratch, const queries::RecordedFrame* sensed) {
  seen_[frame & 1] = {};
  host_.use(scratch);
  host_.contacts().begin(frame);
  host_.set_sensed(sensed);
  host_.move(frame);
  fault_.pass(NodeStage::publication, frame);
}

// The publication implements the paper's application-level multicast to other user nodes: it is written once, and every
// user node nearby reads it.
std::uint32_t UserRole::publish(UserStates& states) {
  own_ = {states.size(), static_cast<std::uint32_t>(host_.size())};
  std::uint32_t present = 0;
  for (std::size_t i = 0; i < host_.size(); ++i) {
    const Hosted& object = host_[i];
    if ((object.object.flags & messages::flag_present) != 0) {
      states.add({object.object.number, 0, object.pose});
      ++present;
    } else {
      states.add_absent();
    }
  }
  return present;
}

bool UserRole::send_states(link::Sender& server, messages::RunSender& run) const {
  const auto changed = host_.changed();
  const std::size_t state_bytes = host_.state_bytes();
  messages::TrafficCounts traffic{};  // the server counts
  return run.pump(server, {MessageType::state_update, Endpoint::user(user_), Endpoint::server(), host_.frame(), 0},
                  sizeof(messages::StateRecord) + state_bytes, traffic, [&](std::size_t i, std::byte* where) {
                    const Hosted& object = host_[changed[i]];
                    messages::StateRecord record{object.object, object.pose};
                    record.object.flags &= messages::flag_present | messages::flag_jumped;
                    std::memcpy(where, &record, sizeof record);
                    std::copy_n(host_.state(changed[i]), state_bytes, where + sizeof record);
                  });
}

void UserRole::receive(const MessageView& message, bool between_frames) {
  switch (message.type()) {
    case MessageType::refused:
      refused_ += message.count();
      break;
    case MessageType::notify:
      between_frames ? host_.contacts().add_late(message) : host_.contacts().add(host_.frame(), message);
      break;
    default:
      host_.apply(message);
  }
}

void UserRole::prefetch_move() const noexcept {
  base::prefetch_for_read(&user_);
  base::prefetch_object(host_);
}

void UserRole::prefetch_read() const noexcept {
  base::prefetch_for_read(&user_);
  base::prefetch_for_read(&host_);
}

}  // namespace ringfence::nodes
