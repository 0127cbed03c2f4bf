#include "nodes/user/user_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

UserRole::UserRole(const UserSetup& setup)
    : setup_(setup),
      self_(Endpoint::user(setup.user)),
      fault_(setup.faults),
      host_(setup.model, setup.objects, &fault_),
      reader_(*setup.publications, setup.user, setup.interest) {
  host_.sense(setup.sense);
}

Step UserRole::resume() {
  while (advance()) {
  }
  if (stage_ == Stage::abandoned) [[unlikely]] {
    return Step::abandoned;
  }
  return stage_ == Stage::sending_states || stage_ == Stage::finishing ? Step::blocked : Step::idle;
}

Step UserRole::allow_reading() {
  may_read_ = true;
  return resume();
}

Step UserRole::receive(const MessageView& message) {
  switch (message.type()) {
    case MessageType::refused:
      refused_ += message.count();
      break;
    case MessageType::notify:
      receive_contacts(message);
      break;
    default:
      host_.apply(message);
  }
  return resume();
}

void UserRole::receive_contacts(const MessageView& message) {
  // Contacts that arrive between frames are those of the last frame, for objects that this node has adopted since.
  const bool late = stage_ == Stage::waiting;
  if (!late && stage_ == Stage::awaiting_contacts) {
    enter(telemetry::StepClock::end);
  }
  late ? host_.contacts().add_late(message) : host_.contacts().add(frame_, message);
  contacts_received_ |= message.last() && !late;
}

Step UserRole::begin(std::uint64_t frame) {
  frame_ = frame;
  contacts_received_ = false;
  may_read_ = setup_.interest <= 0;  // without interest the node reads nothing and needs no permission
  frame_stats_ = {};
  enter(telemetry::StepClock::move);
  telemetry::SpanTimer time(setup_.thread.track, "move", frame_stats_.move_ns);
  host_.contacts().begin(frame);
  host_.set_sensed(setup_.publications->sensed);
  if (!move()) [[unlikely]] {
    stage_ = Stage::abandoned;
    return Step::abandoned;
  }
  states_run_.start(host_.changed().size());
  stage_ = Stage::sending_states;
  return resume();
}

// Returns false if the World has abandoned this thread during the move. Then no result of the move may become visible
// to other roles.
bool UserRole::move() {
  Published& visible = setup_.publications->users[setup_.user];
  published_ = visible;
  if (MoveWatch* const watch = setup_.thread.watch) {
    watch->enter(setup_.user);
    move_and_publish();
    if (!watch->leave()) {
      return false;
    }
  } else {
    move_and_publish();
  }
  visible = published_;
  return true;
}

// The publication implements the paper's application-level multicast to other user nodes: it is written once, and every
// user node nearby reads it.
void UserRole::move_and_publish() {
  host_.move(frame_);
  PublicationWriter writer(*setup_.publications, published_, frame_);
  for (std::size_t i = 0; i < host_.size(); ++i) {
    if ((host_[i].object.flags & messages::flag_present) != 0) {
      writer.add(host_[i].object.number, host_[i].pose);
    }
  }
  fault_.pass(NodeStage::publication, frame_);
  frame_stats_.published = writer.publish();
}

bool UserRole::send_states() {
  const auto changed = host_.changed();
  return states_run_.pump(*setup_.server, {MessageType::state_update, self_, Endpoint::server(), frame_, 0},
                          sizeof(messages::StateRecord) + host_.state_bytes(), traffic_,
                          [&](std::size_t i, std::byte* where) {
                            const Hosted& object = host_[changed[i]];
                            const messages::StateRecord record{object.object, object.pose};
                            std::memcpy(where, &record, sizeof record);
                            std::copy_n(host_.state(changed[i]), host_.state_bytes(), where + sizeof record);
                          });
}

bool UserRole::send_frame_done() {
  return frame_done_run_.send(*setup_.server, {MessageType::frame_done, self_, Endpoint::server(), frame_, 0}, traffic_,
                              [this](std::size_t) {
                                host_.report(frame_stats_);
                                return frame_stats_;
                              });
}

void UserRole::enter(telemetry::StepClock::Step step) noexcept {
  if (setup_.thread.clock != nullptr) {
    setup_.thread.clock->enter(step);
  }
}

// Makes one transition to the next stage. Returns false if the role has to wait.
bool UserRole::advance() {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::sending_states:
      if (!send_states()) {
        return false;
      }
      stage_ = Stage::reading_others;
      return true;
    case Stage::reading_others:
      if (!may_read_) {
        return false;
      }
      enter(telemetry::StepClock::read_publications);
      {
        telemetry::SpanTimer time(setup_.thread.track, "read publications", frame_stats_.busy_ns);
        reader_.read(host_, frame_);
      }
      stage_ = Stage::awaiting_contacts;
      return true;
    case Stage::awaiting_contacts:
      if (!contacts_received_) {
        return false;
      }
      enter(telemetry::StepClock::end);
      frame_done_run_.start(1);
      stage_ = Stage::finishing;
      return true;
    case Stage::finishing:
      if (!send_frame_done()) {
        return false;
      }
      stage_ = Stage::waiting;
      return true;
    case Stage::abandoned:
      return false;
  }
  return false;
}

}  // namespace ringfence::nodes
