// The calls of World that make requests or read results. world.cpp has the frame.
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/floating_point.hpp"
#include "facade/implementation.hpp"
#include "facade/results/object_views.hpp"
#include "facade/save/collect.hpp"
#include "facade/save/save_format.hpp"
#include "ringfence/world.hpp"

namespace ringfence {

const WorldConfig& World::config() const noexcept { return implementation_->state.config; }

// Shapes.

ShapeId World::add_shape(const ShapeDescription& description) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.frame_is_running()) {
    throw Error("add_shape: a frame is running; register shapes before begin_frame or after finish_frame");
  }
  if (w.state.halt.is_set()) {
    throw Error("add_shape: memory ran out in a frame; destroy the World and create another");
  }
  return ShapeId(w.add_shape(description));
}

Status World::remove_shape(ShapeId shape) {
  Implementation& w = *implementation_;
  return w.answer([&] {
    if (w.frame_is_running()) {
      return w.requests.refuse(Status::out_of_order);
    }
    if (!w.state.shapes.has(shape.number())) {
      return w.requests.refuse(Status::unknown_shape);
    }
    if (w.requests.objects().uses(shape.number())) {
      return w.requests.refuse(Status::shape_in_use);
    }
    w.remove_shape(shape.number());
    return Status::ok;
  });
}

const ShapeDescription& World::shape(ShapeId shape) const noexcept {
  return implementation_->state.shapes.description(shape.number());
}

bool World::has_shape(ShapeId shape) const noexcept { return implementation_->state.shapes.has(shape.number()); }

std::size_t World::shape_count() const noexcept { return implementation_->state.shapes.size(); }

// Users and objects.

Connected World::connect(UserId user) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.connect(user); });
}

Status World::disconnect(UserId user) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.disconnect(user); });
}

Spawned World::spawn(const ObjectSpec& spec) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.spawn(spec); });
}

Status World::destroy(ObjectId object) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.destroy(object); });
}

Status World::destroy(UserId user, ObjectId object) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.destroy(user, object); });
}

Status World::move(UserId user, ObjectId object, const Pose& pose) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.move(user, object, pose); });
}

Status World::input(UserId user, ObjectId object, std::span<const std::byte> bytes) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.input(user, object, bytes); });
}

Status World::place(ObjectId object, const Pose& pose) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.place(object, pose); });
}

Status World::set_enabled(ObjectId object, bool enabled) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.set_enabled(object, enabled); });
}

Status World::set_group(ObjectId object, std::uint32_t group) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.set_group(object, group); });
}

Status World::set_layer(ObjectId object, std::uint8_t layer) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.set_layer(object, layer); });
}

Status World::set_shape(ObjectId object, ShapeId shape) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.set_shape(object, shape); });
}

Status World::set_state(ObjectId object, std::span<const std::byte> bytes) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.requests.set_state(object, bytes); });
}

// CD nodes and faults.

Status World::resize(std::uint32_t nodes) {
  Implementation& w = *implementation_;
  return w.answer([&] { return w.membership.resize(nodes, *w.server); });
}

std::uint32_t World::nodes() const noexcept {
  const Implementation& w = *implementation_;
  const bool before_first_frame = w.frames == w.state.first_frame;
  return static_cast<std::uint32_t>(before_first_frame ? w.nodes.pool().size() : w.report.nodes.size());
}

std::optional<NodeId> World::node_at(const Vec3d& position) const noexcept {
  const Implementation& w = *implementation_;
  if (w.frame_is_running()) {
    return {};
  }
  std::uint32_t point[3];
  w.state.space.point(position, point);
  const facade::PoolNode* node = w.nodes.pool().at(w.server->map().owner_at(point));
  return node == nullptr ? std::optional<NodeId>() : NodeId(node->id);
}

Status World::inject(const Fault& fault) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] {
    if (w.frame_is_running()) {
      return w.requests.refuse(Status::out_of_order);
    }
    return w.inject(fault) ? Status::ok : w.requests.refuse(Status::bad_number);
  });
}

void World::fail_thread_creation(std::uint32_t succeed_first) noexcept {
  implementation_->state.starter.fail_after(succeed_first);
}

std::uint32_t World::release_faults() noexcept {
  Implementation& w = *implementation_;
  const std::uint32_t stopped = w.state.faults.release();
  w.nodes.pool().each_worker([](facade::Worker& worker) { worker.bell().ring(); });
  return stopped;
}

// Results of the last frame.

std::span<const Contact> World::contacts() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().contacts(w.frames - 1);
}

std::span<const Contact> World::ended() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().ended(w.frames - 1);
}

std::span<const Contact> World::collisions_of(UserId user) const noexcept {
  const nodes::UserRole* role = implementation_->reader(user);
  return role == nullptr ? std::span<const Contact>{} : role->contacts(implementation_->frames - 1);
}

std::uint64_t World::refused(UserId user) const noexcept {
  const Implementation& w = *implementation_;
  if (w.frame_is_running()) {
    return 0;
  }
  const nodes::UserRole* role = w.reader(user);
  return w.requests.refused(user.number()) + (role == nullptr ? 0 : role->refused());
}

ObjectContacts World::collisions_of(ObjectId object) const {
  const Implementation& w = *implementation_;
  if (w.requests.objects().find(object) == nullptr || w.frames == 0) {
    return {};
  }
  w.contact_index.update(w.frames, contacts());
  return {contacts().data(), w.contact_index.of(object.number())};
}

std::span<const std::span<const SeenState>> World::seen_by(UserId user) const noexcept {
  const Implementation& w = *implementation_;
  const nodes::UserRole* role = w.reader(user);
  if (role == nullptr || w.state.halt.is_set()) {
    return {};  // after a halt: without threads, the frame that was not completed may have overwritten the states
  }
  return role->seen(w.frames - 1);
}

Status World::attach(QueryBatch& batch) {
  Implementation& w = *implementation_;
  return w.answer([&] {
    const Status status = w.frame_is_running() ? Status::out_of_order : w.batches.attach(batch);
    return status == Status::ok ? status : w.requests.refuse(status);
  });
}

Snapshot World::snapshot() const {
  const base::DefaultFloatingPoint floating_point;
  const Implementation& w = *implementation_;
  if (w.frames == 0) {
    return {};
  }
  if (!w.frame_is_running() && !w.state.halt.is_set()) {
    w.frame_store.record(*w.server, w.frames - 1);
  }
  return w.frame_store.has(w.frames - 1) ? Snapshot(w.frame_store.pin()) : Snapshot();
}

ObjectView World::object(ObjectId object) const noexcept {
  const std::uint32_t slot = implementation_->slot_of(object);
  return slot == base::NumberIndex::none ? ObjectView{} : facade::view_of(*implementation_->server, slot);
}

std::span<const std::byte> World::state(ObjectId object) const noexcept {
  const Implementation& w = *implementation_;
  const MotionModel* model = w.state.config.motion.get();
  const std::uint32_t slot = model == nullptr ? base::NumberIndex::none : w.slot_of(object);
  if (slot == base::NumberIndex::none) {
    return {};
  }
  return {w.server->state(slot), model->state_bytes()};
}

std::vector<ObjectView> World::objects() const {
  const Implementation& w = *implementation_;
  return w.frame_is_running() ? std::vector<ObjectView>() : facade::views_of(*w.server);
}

Status World::save(Sink& sink, std::span<const std::byte> own) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] {
    if (w.frame_is_running()) {
      return w.requests.refuse(Status::out_of_order);
    }
    if (!facade::can_be_saved(w.state.shapes)) {
      return w.requests.refuse(Status::bad_shape);
    }
    const facade::SavedWorld saved = facade::collect(w.state, w.requests, *w.server, w.frames, own);
    return facade::write_save(saved, sink) ? Status::ok : w.requests.refuse(Status::not_written);
  });
}

Status World::apply(std::span<const std::byte> inputs) {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  return w.answer([&] {
    if (w.frame_is_running()) {
      return w.requests.refuse(Status::out_of_order);
    }
    try {
      w.apply(facade::read_inputs(inputs, w.state.config.support_functions));
    } catch (const Error& error) {
      w.state.log.write(LogLevel::error, error.what());
      return w.requests.refuse(Status::bad_message);
    }
    return Status::ok;
  });
}

std::span<const std::byte> World::saved_bytes() const noexcept { return implementation_->own; }

ObjectId World::find(ObjectNumber number) const noexcept { return implementation_->requests.objects().find(number); }

}  // namespace ringfence
