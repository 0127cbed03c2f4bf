#include "nodes/host/host.hpp"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/host/valid_pose.hpp"

namespace ringfence::nodes {

using messages::flag_adopted;
using messages::flag_host_owned;
using messages::flag_jumped;
using messages::flag_placed;
using messages::flag_present;
using messages::flag_renewed;

namespace {

/// Before the move of an object: it has jumped in this frame only if it was placed at the cut, and the server sends it
/// only if it was adopted there.
void begin_flags(std::uint32_t& flags) noexcept {
  flags = (flags & (flag_present | flag_host_owned)) | ((flags & flag_placed) != 0 ? flag_jumped : 0u) |
          ((flags & flag_adopted) != 0 ? flag_renewed : 0u);
}

}  // namespace

Host::Host(const MotionModel* model, std::size_t objects, FaultPoint* fault, bool shares_scratch)
    : HostedObjects(objects, model == nullptr ? 0 : (model->state_bytes() + 7) / 8 * 8),
      model_(model),
      fault_(fault),
      uses_contacts_(model != nullptr && model->uses_contacts()),
      contacts_(objects) {
  if (!shares_scratch) {
    own_scratch_ = std::make_unique<MoveScratch>();
    scratch_ = own_scratch_.get();
    scratch_->changed.reserve(objects);
    scratch_->differs.reserve(objects);
    scratch_->grow_batch(std::min(batch, objects), state_bytes_);
  }
}

void Host::sense(double distance) {
  if (distance > 0) {
    senses_ = std::make_unique<HostSenses>(distance);
  }
}

void Host::move(std::uint64_t frame) {
  begin_move(frame);
  move_batches(0, hosted_.size());
  for (const Steered& steered : steered_) {
    const std::uint32_t i = index_.find(steered.number);
    if (i != base::NumberIndex::none) {
      hosted_[i].pose = steered.pose;
      hosted_[i].object.flags = flag_present;
      touched_[i] = 1;
    }
  }
  steered_.clear();
  end_move();
  collect_changed(0, hosted_.size());
}

void Host::report(messages::NodeFrameStats& stats) const noexcept {
  stats.hosted += size();
  stats.model_failed += refusals_.model_failed;
  stats.not_finite += refusals_.not_finite;
  stats.not_unit += refusals_.not_unit;
}

void Host::begin_move(std::uint64_t frame) {
  frame_ = frame;
  next_moved_ = 0;
  scratch_->changed.clear();
  refusals_ = {};
  failures_.clear();
  list_all_ = std::exchange(list_all_next_, false);
  if (uses_contacts_ && !hosted_.empty()) {
    contacts_.begin_move(frame, *this);
  }
  if (!frame_inputs_.empty()) {
    frame_inputs_.find_objects(index_);
  }
}

void Host::end_move() noexcept {
  contacts_.end_move(frame_);
  frame_inputs_.clear();
}

bool Host::move_next() {
  assert(steered_.empty());
  scratch_->changed.clear();
  if (next_moved_ == hosted_.size()) {
    end_move();
    return false;
  }
  const std::size_t end = std::min(next_moved_ + batch, hosted_.size());
  move_batches(next_moved_, end);
  collect_changed(next_moved_, end);
  next_moved_ = end;
  return true;
}

void Host::move_batches(std::size_t first, std::size_t end) {
  if (model_ == nullptr) {
    return;
  }
  for (std::size_t at = first; at < end; at += batch) {
    move_batch(at, std::min(batch, end - at));
  }
}

void Host::collect_changed(std::size_t first, std::size_t end) {
  base::FlatList<std::uint32_t>& list = scratch_->changed;
  base::FlatList<std::uint8_t>& differs = scratch_->differs;
  list.resize(end - first);
  differs.resize(end - first);
  const std::uint32_t listed_flag = lists_host_owned_ ? flag_host_owned : 0u;
  std::size_t changed = 0;
  for (std::size_t i = first; i < end; ++i) {
    std::uint32_t& flags = hosted_[i].object.flags;
    if (model_ == nullptr) {
      begin_flags(flags);
    }
    list[changed] = static_cast<std::uint32_t>(i);
    differs[changed] = touched_[i];
    changed += list_all_ ? 1 : touched_[i] | ((flags & listed_flag) / flag_host_owned);
  }
  std::fill(touched_.begin() + static_cast<std::ptrdiff_t>(first), touched_.begin() + static_cast<std::ptrdiff_t>(end),
            std::uint8_t{0});
  list.resize(changed);
  differs.resize(changed);
}

void Host::move_batch(std::size_t first, std::size_t count) {
  if (count > scratch_->inputs.size()) [[unlikely]] {
    scratch_->grow_batch(batch, state_bytes_);
  }
  // Once, although the model may be called twice.
  for (std::size_t i = 0; i < count; ++i) {
    begin_flags(hosted_[first + i].object.flags);
  }
  if (call_model(first, count)) {
    accept(first, count);
    return;
  }
  // The model threw somewhere in the batch. It is pure, so each object is tried alone, and only those for which it
  // throws do not move.
  for (std::size_t i = 0; i < count; ++i) {
    if (call_model(first + i, 1)) {
      accept(first + i, 1);
    } else {
      ++refusals_.model_failed;
    }
  }
}

// Objects do not stay in the cache from frame to frame, and the contacts of an object are scattered. Only the geometry
// of a contact is prefetched.
void Host::prefetch(std::size_t i) const noexcept {
  if (i >= hosted_.size()) {
    return;
  }
  base::prefetch_for_write(&hosted_[i]);
  if (state_bytes_ != 0) {
    base::prefetch_for_write(state(i));
  }
  for (const std::uint32_t c : contacts_of(i)) {
    const auto* contact = reinterpret_cast<const std::byte*>(&contacts_.list()[c]);
    base::prefetch_for_read(contact);
    base::prefetch_for_read(contact + offsetof(Contact, generation_a) - 1);
  }
}

bool Host::call_model(std::size_t first, std::size_t count) {
  std::vector<MotionInput>& inputs = scratch_->inputs;
  std::byte* const states = scratch_->states.data();
  if (state_bytes_ != 0) {
    std::memcpy(states, state(first), count * state_bytes_);
  }
  for (std::size_t i = 0; i < count; ++i) {
    prefetch(first + batch + i);
    const Hosted& hosted = hosted_[first + i];
    const bool present = (hosted.object.flags & flag_present) != 0;
    inputs[i] = {hosted.object.number,
                 ShapeId(hosted.shape),
                 static_cast<Category>(hosted.category),
                 present,
                 hosted.user_data,
                 hosted.pose,
                 state(first + i),
                 ObjectContacts(contacts_.list(), contacts_of(first + i)),
                 {},
                 nullptr};
    // Field by field: g++ 12 puts an aggregate together on the stack and copies it by loads that are wider than the
    // stores before them, so each waits until those stores are in the cache (5 % of a frame).
    MotionOutput& output = scratch_->outputs[i];
    output.pose = hosted.pose;
    output.enabled = present;
    output.state = states + i * state_bytes_;
    output.jump = false;
  }
  if (!frame_inputs_.empty()) {
    frame_inputs_.set(first, std::span(inputs).first(count));
  }
  if (senses_ != nullptr) {
    senses_->give(std::span(inputs).first(count), std::span(hosted_.span()).subspan(first, count));
  }
  if (fault_ != nullptr) {
    fault_->pass(NodeStage::model, frame_);
  }
  try {
    model_->move(frame_, std::span(std::as_const(inputs)).first(count), std::span(scratch_->outputs).first(count));
  } catch (...) {
    if (count == 1) {
      const messages::ObjectRef& object = hosted_[first].object;
      failures_.add_current(ObjectId::of(object.number, object.generation));
    }
    return false;
  }
  return true;
}

// Takes over the states that the model has returned, except those of objects whose output is refused.
void Host::accept(std::size_t first, std::size_t count) {
  std::byte* const states = scratch_->states.data();
  for (std::size_t i = 0; i < count; ++i) {
    std::byte* const next = states + i * state_bytes_;
    if (!accept(first + i, scratch_->outputs[i], next) && state_bytes_ != 0) {
      std::memcpy(next, state(first + i), state_bytes_);
    }
  }
  if (state_bytes_ != 0) {
    std::memcpy(states_.data() + first * state_bytes_, states, count * state_bytes_);
  }
}

bool Host::accept(std::size_t i, const MotionOutput& output, const std::byte* next) {
  Hosted& hosted = hosted_[i];
  const std::uint32_t flags = (output.enabled ? flag_present : 0u) | (output.jump ? flag_jumped : 0u) |
                              (hosted.object.flags & (flag_host_owned | flag_jumped | flag_renewed));
  const bool moved = !(output.pose == hosted.pose);  // a pose with NaN counts as moved and is refused
  if (moved && is_exact_pose(output.pose)) [[likely]] {
    hosted.pose = output.pose;
  } else if (moved) {
    Pose pose = output.pose;
    const Status status = make_valid(pose);
    if (status != Status::ok) {
      ++(status == Status::not_finite ? refusals_.not_finite : refusals_.not_unit);
      return false;
    }
    hosted.pose = pose;
  }
  if (moved || flags != hosted.object.flags || (state_bytes_ != 0 && std::memcmp(state(i), next, state_bytes_) != 0)) {
    touched_[i] = 1;
  }
  hosted.object.flags = flags;
  return true;
}

}  // namespace ringfence::nodes
