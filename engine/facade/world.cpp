// A World from its construction to its end, and its frames. world_calls.cpp has the other calls.
#include "ringfence/world.hpp"

#include <new>
#include <utility>

#include "base/floating_point.hpp"
#include "facade/implementation.hpp"
#include "facade/save/save_format.hpp"

namespace ringfence {

World::World(WorldConfig config) {
  const base::DefaultFloatingPoint floating_point;
  implementation_ = std::make_unique<Implementation>(std::move(config));
}

World::World(WorldConfig config, Source& source) {
  const base::DefaultFloatingPoint floating_point;
  const facade::SavedWorld saved = facade::read_save(source, config.support_functions);
  implementation_ = std::make_unique<Implementation>(std::move(config), saved);
}

World::World(World&& other) noexcept = default;

World& World::operator=(World&& other) noexcept {
  if (this != &other) {
    { const World ended(std::move(*this)); }
    implementation_ = std::move(other.implementation_);
  }
  return *this;
}

World::~World() {
  if (implementation_ == nullptr) {
    return;  // moved from
  }
  const base::DefaultFloatingPoint floating_point;
  release_faults();
  implementation_->batches.detach();
  if (implementation_->frame_is_running() && !implementation_->state.halt.is_set()) {
    (void)finish_frame();  // its results are not read
  }
}

Status World::advance() {
  const Status status = begin_frame();
  return status == Status::ok ? finish_frame() : status;
}

Status World::begin_frame() try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.state.halt.is_set()) {
    return w.stop_frames();
  }
  if (w.frame_is_running()) {
    return w.requests.refuse(Status::out_of_order);
  }
  if (w.unrecorded || (w.state.config.recorder != nullptr && !w.record(*this))) {
    return w.requests.refuse(Status::journal_failed);
  }
  w.requests.cut(w.state.order);
  w.state.choose_bounds();
  w.batches.prepare(w.state.order);
  w.state.publications.sensed = w.sensed_frames.prepare(*w.server, w.frames);
  w.users.apply_requests();
  w.membership.cut(*w.server);
  w.users.steer(w.requests.user_orders());
  w.order_frame();
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::finish_frame() try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.state.halt.is_set()) {
    return w.stop_frames();
  }
  if (!w.frame_is_running()) {
    return w.requests.refuse(Status::out_of_order);
  }
  if (!w.await_frame()) {
    return w.stop_frames();
  }
  ++w.frames;
  if (w.frame_store.keeps_history()) {
    w.frame_store.record(*w.server, w.frames - 1);
  }
  w.users.forget(w.requests.users().cut_leaving());
  w.requests.forget_cut(w.state.order);
  w.take_report();
  if (!w.batches.empty()) {
    w.batches.answer(*w.server, w.report, [this] { return snapshot(); });
  }
  w.complete_report();
  w.free_gone_roles();
  for (const UserId user : w.report.late) {
    if (w.requests.users().is_connected(user.number())) {
      (void)disconnect(user);  // is connected
    }
  }
  w.log_frame();
  if (w.state.config.recorder != nullptr && !w.acknowledge(*this)) {
    return w.requests.refuse(Status::journal_failed);
  }
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

std::uint64_t World::frames() const noexcept { return implementation_->frames; }

const FrameReport& World::report() const noexcept { return implementation_->report; }

}  // namespace ringfence
