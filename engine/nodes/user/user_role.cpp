#include "nodes/user/user_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"
#include "telemetry/clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

namespace {

/// Adds its life time to a timeline. There are many user nodes, so it reads the clock only if there is a timeline.
class Span {
 public:
  Span(telemetry::Track* track, const char* name) noexcept
      : track_(track), name_(name), begin_ns_(track != nullptr ? telemetry::now_ns() : 0) {}
  ~Span() {
    if (track_ != nullptr) {
      track_->add(name_, begin_ns_, telemetry::now_ns());
    }
  }
  Span(const Span&) = delete;
  Span& operator=(const Span&) = delete;

 private:
  telemetry::Track* track_;
  const char* name_;
  std::uint64_t begin_ns_;
};

}  // namespace

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
  enter(telemetry::StepClock::move);
  const Span span(setup_.thread.track, "move");
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
  published_states_ = writer.publish();
}

bool UserRole::send_states() {
  const auto changed = host_.changed();
  messages::TrafficCounts traffic{};  // the server counts
  return states_run_.pump(*setup_.server, {MessageType::state_update, self_, Endpoint::server(), frame_, 0},
                          sizeof(messages::StateRecord) + host_.state_bytes(), traffic,
                          [&](std::size_t i, std::byte* where) {
                            const Hosted& object = host_[changed[i]];
                            const messages::StateRecord record{object.object, object.pose};
                            std::memcpy(where, &record, sizeof record);
                            std::copy_n(host_.state(changed[i]), host_.state_bytes(), where + sizeof record);
                          });
}

bool UserRole::send_frame_done() {
  messages::TrafficCounts traffic{};
  return frame_done_run_.send(*setup_.server, {MessageType::frame_done, self_, Endpoint::server(), frame_, 0}, traffic,
                              [this](std::size_t) {
                                messages::NodeFrameStats stats;
                                stats.published = published_states_;
                                host_.report(stats);
                                return stats;
                              });
}

void UserRole::prefetch(bool begins) const noexcept {
  if (begins) {
    base::prefetch_object(*this);
    return;
  }
  base::prefetch_object(published_);
  base::prefetch_object(reader_);
  base::prefetch_object(frame_done_run_);
  host_.prefetch_report();
}

void UserRole::prefetch_arrays(bool begins) const noexcept {
  if (begins) {
    host_.prefetch_move();
    if (published_.publication != nullptr) {  // it has moved before
      base::prefetch_object(*published_.publication);
    }
  } else {
    host_.prefetch_first();
    reader_.prefetch_arrays();
  }
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
        const Span span(setup_.thread.track, "read publications");
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
