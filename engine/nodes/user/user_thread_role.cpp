#include "nodes/user/user_thread_role.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

namespace {

/// Number of user nodes that a thread steps before it wakes the server.
constexpr std::size_t users_a_ring = 16;

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

UserThreadRole::UserThreadRole(const UserThreadSetup& setup, std::vector<UserRole*> users)
    : setup_(setup),
      users_(std::move(users)),
      state_bytes_(users_.empty() ? 0 : users_.front()->state_bytes()),
      next_(users_.size()) {}

UserThreadRole::UserThreadRole(const UserThreadRole& stalled, const UserThreadParts& parts,
                               std::vector<UserRole*> users)
    : UserThreadRole(stalled.setup_, std::move(users)) {
  setup_.parts = parts;
  task_ = stalled.task_;
  frame_ = stalled.frame_;
  between_frames_ = stalled.between_frames_;
  published_ = stalled.published_;
  stats_ = stalled.stats_;
  if (stalled.next_ < stalled.users_.size()) {
    next_ = position_of(stalled.users_[stalled.next_]->number());
  }
}

Step UserThreadRole::step() {
  // The server works and sends meanwhile.
  constexpr std::size_t messages_a_ring = 16;
  link::Sender& out = *setup_.server.out;
  link::Receiver& in = *setup_.server.in;
  const auto before = std::tuple(task_, next_, sending_);
  std::size_t received = 0;
  out.set_quiet(true);
  Step step = resume();
  while (step == Step::idle) {
    const std::span<const std::byte> bytes = in.next();
    if (bytes.empty()) {
      break;
    }
    step = receive(bytes);
    if (step != Step::abandoned && ++received % messages_a_ring == 0) {
      in.release();
      out.ring_unrung();
    }
  }
  if (step == Step::abandoned) [[unlikely]] {
    return step;
  }
  in.release();
  out.ring_unrung();
  return received != 0 || before != std::tuple(task_, next_, sending_) ? Step::progressed : step;
}

Step UserThreadRole::receive(std::span<const std::byte> bytes) {
  MessageView message;
  if (messages::decode(bytes, state_bytes_, message) != Status::ok || message.header().frame < setup_.first_frame) {
    return Step::idle;
  }
  const Endpoint destination{message.header().destination};
  if (destination == Endpoint::all_users()) {
    start(message.header());
    return resume();
  }
  if (message.type() == MessageType::notify && !between_frames_) {
    enter(telemetry::StepClock::end);
  }
  if (UserRole* const user = find(destination.number())) {
    user->receive(message, between_frames_);
  }
  return Step::idle;
}

void UserThreadRole::start(const messages::Header& header) {
  next_ = 0;
  switch (static_cast<MessageType>(header.type)) {
    case MessageType::frame_begin:
      enter(telemetry::StepClock::move);
      task_ = Task::move;
      frame_ = header.frame;
      between_frames_ = false;
      published_ = 0;
      stats_ = {};
      setup_.server.publication->published.any[frame_ & 1] = false;
      setup_.server.publication->publication.begin(frame_);
      setup_.server.publication->users.clear();
      break;
    case MessageType::read_publications:
      enter(telemetry::StepClock::read_publications);
      task_ = Task::read;
      setup_.parts.reader->begin(frame_, setup_.server.publication);
      break;
    case MessageType::notify:  // all contacts of the frame have arrived
      enter(telemetry::StepClock::end);
      task_ = Task::send_frame_done;
      between_frames_ = true;
      run_.start(1);
      break;
    default:
      break;
  }
}

Step UserThreadRole::resume() {
  if (task_ == Task::move) {
    if (const Step step = move_all(); step != Step::idle) {
      return step;
    }
    publish();
    run_.start(0);
    task_ = Task::send_published;
  } else if (task_ == Task::read) {
    read_all();
    task_ = Task::none;
  }
  if ((task_ == Task::send_published && !send_published()) || (task_ == Task::send_frame_done && !send_frame_done())) {
    return Step::blocked;
  }
  task_ = Task::none;
  return Step::idle;
}

Step UserThreadRole::move_all() {
  while (true) {
    if (sending_ != nullptr && !sending_->send_states(*setup_.server.out, run_)) {
      return Step::blocked;
    }
    sending_ = nullptr;
    if (next_ == users_.size()) {
      return Step::idle;
    }
    prefetch_moves();
    UserRole* const user = users_[next_++];
    if (!move(*user)) [[unlikely]] {
      return Step::abandoned;
    }
    published_ += user->publish(setup_.server.publication->users);
    user->host().report(stats_);
    run_.start(user->changed());
    sending_ = user;
    if (next_ % users_a_ring == 0) {
      setup_.server.out->ring_unrung();
    }
  }
}

// Returns false if the World has abandoned this thread during the move. Then no result of the move may become visible
// to other roles.
bool UserThreadRole::move(UserRole& user) {
  const Span span(setup_.parts.track, "move");
  // Read before the move begins: an abandoned thread may be in it when the World sets the frame for the next move.
  const queries::RecordedFrame* const sensed = setup_.publications->sensed;
  MoveWatch* const watch = setup_.parts.watch;
  if (watch != nullptr) {
    watch->enter(user.number());
  }
  user.move(frame_, scratch_, sensed);
  return watch == nullptr || watch->leave();
}

void UserThreadRole::publish() {
  HostPublication& own = *setup_.server.publication;
  own.users.publish(own.publication);
  note_published(own.published, frame_);
  stats_.published = published_;
}

void UserThreadRole::read_all() {
  while (next_ < users_.size()) {
    prefetch_reads();
    const Span span(setup_.parts.track, "read publications");
    users_[next_++]->read(*setup_.parts.reader);
  }
}

bool UserThreadRole::send_published() {
  messages::TrafficCounts traffic{};  // the server counts
  return run_.pump(*setup_.server.out, {MessageType::published, Endpoint::all_users(), Endpoint::server(), frame_, 0},
                   0, traffic, [](std::size_t, std::byte*) {});
}

bool UserThreadRole::send_frame_done() {
  messages::TrafficCounts traffic{};
  return run_.send(*setup_.server.out, {MessageType::frame_done, Endpoint::all_users(), Endpoint::server(), frame_, 0},
                   traffic, [this](std::size_t) { return stats_; });
}

void UserThreadRole::enter(telemetry::StepClock::Step step) noexcept {
  if (setup_.parts.clock != nullptr) {
    setup_.parts.clock->enter(step);
  }
}

// Of many user nodes none is in a cache. First the lines of the object, then those that its pointers refer to.
void UserThreadRole::prefetch_moves() const noexcept {
  constexpr std::size_t ahead = 4;
  if (next_ + 2 * ahead < users_.size()) {
    users_[next_ + 2 * ahead]->prefetch_move();
    users_[next_ + ahead]->prefetch_arrays();
  }
}

void UserThreadRole::prefetch_reads() const noexcept {
  constexpr std::size_t ahead = 4;
  if (next_ + 2 * ahead < users_.size()) {
    users_[next_ + 2 * ahead]->prefetch_read();
    users_[next_ + ahead]->prefetch_avatar();
  }
}

std::size_t UserThreadRole::position_of(UserNumber number) const noexcept {
  const auto is_before = [](const UserRole* user, UserNumber wanted) { return user->number() < wanted; };
  return static_cast<std::size_t>(std::lower_bound(users_.begin(), users_.end(), number, is_before) - users_.begin());
}

// The server sends to the user nodes in the order of their numbers.
UserRole* UserThreadRole::find(UserNumber number) noexcept {
  if (guess_ >= users_.size() || users_[guess_]->number() != number) {
    guess_ = position_of(number);
  }
  return guess_ < users_.size() && users_[guess_]->number() == number ? users_[guess_++] : nullptr;
}

}  // namespace ringfence::nodes
