// Calls of World that make requests for the next frame's cut.
#include <algorithm>
#include <cmath>
#include <new>
#include <string>

#include "base/floating_point.hpp"
#include "facade/config_check.hpp"
#include "facade/implementation.hpp"
#include "nodes/host/valid_pose.hpp"

namespace ringfence {

using facade::Steppable;
using facade::Worker;
using nodes::Request;

ShapeId World::add_shape(const ShapeDescription& description) {
  const base::DefaultFloatingPoint floating_point;
  if (implementation_->frame_is_running()) {
    throw Error("add_shape: a frame is running; register shapes before begin_frame or after finish_frame");
  }
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    throw Error("add_shape: memory ran out in a frame; destroy the World and create another");
  }
  const ShapeNumber shape = w.shapes.add(description);
  if (w.config.remote_nodes != nullptr) {
    w.config.remote_nodes->add_shape(shape, description);
  }
  if (w.shapes.row(shape).kind == ShapeKind::mesh) {
    const geometry::Mesh& mesh = w.shapes.mesh(w.shapes.row(shape).index_in_kind);
    if (mesh.dropped_triangles() > 0) {
      w.log(LogLevel::warning, "shape " + std::to_string(shape) + ": " + std::to_string(mesh.dropped_triangles()) +
                                   " triangles without area are dropped from the mesh, " +
                                   std::to_string(mesh.triangles().size()) + " are kept");
    }
  }
  return ShapeId(shape);
}

Status World::remove_shape(ShapeId shape) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (w.frame_is_running()) {
    return w.refuse(Status::out_of_order);
  }
  if (!w.shapes.has(shape.number())) {
    return w.refuse(Status::unknown_shape);
  }
  if (w.registry.uses(shape.number())) {
    return w.refuse(Status::shape_in_use);
  }
  w.shapes.remove(shape.number());
  if (w.config.remote_nodes != nullptr) {
    w.config.remote_nodes->remove_shape(shape.number());
  }
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Connected World::connect(UserId wanted) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return {Status::out_of_memory, no_user};
  }
  const auto taken = [&](UserNumber number) {
    const auto holds = [&](const std::vector<UserNumber>& list) {
      return std::find(list.begin(), list.end(), number) != list.end();
    };
    return w.is_connected(number) || holds(w.leaving) || holds(w.cut_leaving);
  };
  UserNumber user = wanted.number();
  if (wanted == no_user) {
    user = 0;
    while (taken(user)) {
      ++user;
    }
  }
  if (user >= w.config.limits.users) {
    return {w.refuse(Status::over_capacity), no_user};
  }
  if (taken(user)) {
    return {w.refuse(Status::number_in_use), no_user};
  }
  w.users.insert(std::lower_bound(w.users.begin(), w.users.end(), user), user);
  Request request;
  request.kind = Request::Kind::connect;
  request.user = user;
  w.requests.push_back(request);
  return {Status::ok, UserId(user)};
} catch (const std::bad_alloc&) {
  return {implementation_->stop_frames(), no_user};
}

Status World::disconnect(UserId id) try {
  Implementation& w = *implementation_;
  const UserNumber user = id.number();
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (!w.is_connected(user)) {
    return w.refuse(Status::unknown_user);
  }
  w.users.erase(std::lower_bound(w.users.begin(), w.users.end(), user));
  w.leaving.push_back(user);
  w.registry.end_avatars(user);
  std::erase_if(w.pending_moves, [&](const auto& pending_move) { return pending_move.user == user; });
  std::erase_if(w.pending_inputs, [&](const auto& pending_input) { return pending_input.user == user; });
  Request request;
  request.kind = Request::Kind::disconnect;
  request.user = user;
  w.requests.push_back(request);
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Spawned World::spawn(const ObjectSpec& spec) try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return {Status::out_of_memory, {}};
  }
  Request request;
  request.kind = Request::Kind::spawn;
  request.spec = spec;
  Status status = w.check_spec(spec);
  if (status == Status::ok) {
    status = nodes::make_valid(request.spec.pose);
  }
  const ObjectNumber number = spec.number != 0 ? spec.number : w.registry.free_number();
  if (status == Status::ok && number == 0) {
    status = Status::bad_number;
  }
  if (status != Status::ok) {
    return {w.refuse(status), {}};
  }
  request.spec.number = number;
  request.object = w.registry.add(number, spec.category, spec.user.number(), spec.shape.number());
  w.requests.push_back(request);
  return {Status::ok, request.object};
} catch (const std::bad_alloc&) {
  return {implementation_->stop_frames(), {}};
}

Status World::destroy(ObjectId object) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (w.registry.find(object) == nullptr) {
    return w.refuse(Status::stale_object);
  }
  w.registry.end(object);
  Request request;
  request.kind = Request::Kind::destroy;
  request.object = object;
  w.requests.push_back(request);
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::Implementation::check_own(UserId user, ObjectId object) const noexcept {
  if (!is_connected(user.number())) {
    return Status::unknown_user;
  }
  const facade::Registry::Entry* entry = registry.find(object);
  if (entry == nullptr) {
    return Status::stale_object;
  }
  return entry->user == user.number() ? Status::ok : Status::not_host;
}

Status World::destroy(UserId user, ObjectId object) {
  if (implementation_->halt.is_set()) {
    return Status::out_of_memory;
  }
  const Status status = implementation_->check_own(user, object);
  return status == Status::ok ? destroy(object) : implementation_->refuse(status);
}

Status World::move(UserId user, ObjectId object, const Pose& pose) try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (const Status status = w.check_own(user, object); status != Status::ok) {
    return w.refuse(status);
  }
  if (const Status status = nodes::check_pose(pose); status != Status::ok) {
    return w.refuse(status);
  }
  w.pending_moves.push_back({user.number(), object.number(), pose});
  (void)nodes::make_valid(w.pending_moves.back().pose);  // normalises
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::input(UserId user, ObjectId object, std::span<const std::byte> bytes) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (const Status status = w.check_own(user, object); status != Status::ok) {
    return w.refuse(status);
  }
  if (bytes.size() > max_input_bytes) {
    return w.refuse(Status::bad_message);
  }
  auto& pending = w.pending_inputs.emplace_back();
  pending.user = user.number();
  pending.input.number = object.number();
  pending.input.size = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), pending.input.bytes.begin());
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::Implementation::check_movable(ObjectId object) const noexcept {
  const facade::Registry::Entry* entry = registry.find(object);
  if (entry == nullptr) {
    return Status::stale_object;
  }
  return entry->category == Category::fixed ? Status::bad_category : Status::ok;
}

Status World::place(ObjectId object, const Pose& pose) try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (const Status status = w.check_movable(object); status != Status::ok) {
    return w.refuse(status);
  }
  Request request;
  request.kind = Request::Kind::place;
  request.object = object;
  request.spec.pose = pose;
  if (const Status status = nodes::make_valid(request.spec.pose); status != Status::ok) {
    return w.refuse(status);
  }
  w.requests.push_back(request);
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::set_enabled(ObjectId object, bool enabled) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (const Status status = w.check_movable(object); status != Status::ok) {
    return w.refuse(status);
  }
  if (!enabled) {
    std::erase_if(w.pending_moves, [&](const auto& pending_move) { return pending_move.number == object.number(); });
  }
  Request request;
  request.kind = Request::Kind::set_enabled;
  request.object = object;
  request.spec.enabled = enabled;
  w.requests.push_back(request);
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::Implementation::request_change(Request::Kind kind, ObjectId object, Status status,
                                             const ObjectSpec& spec) try {
  if (halt.is_set()) {
    return Status::out_of_memory;
  }
  if (registry.find(object) == nullptr) {
    status = Status::stale_object;
  }
  if (status != Status::ok) {
    return refuse(status);
  }
  Request request;
  request.kind = kind;
  request.object = object;
  request.spec = spec;
  requests.push_back(request);
  return Status::ok;
} catch (const std::bad_alloc&) {
  return stop_frames();
}

Status World::set_group(ObjectId object, std::uint32_t group) {
  ObjectSpec spec;
  spec.group = group;
  return implementation_->request_change(Request::Kind::set_group, object, Status::ok, spec);
}

Status World::set_layer(ObjectId object, std::uint8_t layer) {
  Implementation& w = *implementation_;
  ObjectSpec spec;
  spec.layer = layer;
  return w.request_change(Request::Kind::set_layer, object, w.check_layer(layer), spec);
}

Status World::set_shape(ObjectId object, ShapeId shape) try {
  Implementation& w = *implementation_;
  const Status known = w.shapes.has(shape.number()) ? Status::ok : Status::unknown_shape;
  ObjectSpec spec;
  spec.shape = shape;
  const Status status = w.request_change(Request::Kind::set_shape, object, known, spec);
  if (status == Status::ok) {
    w.registry.set_shape(object, shape.number());
  }
  return status;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::set_state(ObjectId object, std::span<const std::byte> bytes) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  const std::size_t size = w.config.motion == nullptr ? 0 : w.config.motion->state_bytes();
  Status status = w.check_movable(object);
  if (status == Status::ok && bytes.size() != size) {
    status = Status::bad_message;
  }
  if (status == Status::ok && size == 0) {
    return Status::ok;
  }
  const std::size_t at = w.states.size();
  status = w.request_change(Request::Kind::set_state, object, status, {});
  if (status == Status::ok) {
    w.requests.back().state = static_cast<std::uint32_t>(at);
    w.states.insert(w.states.end(), bytes.begin(), bytes.end());
  }
  return status;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::resize(std::uint32_t nodes) try {
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  const std::size_t most = w.config.remote_nodes != nullptr ? w.pool.size() : facade::max_nodes;
  if (nodes == 0 || nodes > most || nodes > w.server->map().grid().cells()) {
    return w.refuse(Status::bad_number);
  }
  if (w.threaded() && w.config.remote_nodes == nullptr && !w.prepare_nodes(nodes)) {
    w.resize_to = 0;
    return w.refuse(Status::no_thread);
  }
  w.resize_to = nodes;
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

// A node that the server's thread steps must not block that thread.
bool World::Implementation::can_fail(const Fault& fault) const noexcept {
  if (!threaded() || fault.frame < begun || !std::isfinite(fault.stall_ms) || fault.stall_ms < 0 ||
      static_cast<std::size_t>(fault.stage) >= node_stage_count) {
    return false;
  }
  if (fault.user != no_user) {
    const auto user = user_nodes.find(fault.user.number());
    return user != user_nodes.end() && !user->second->late &&
           (fault.stage == NodeStage::model || fault.stage == NodeStage::publication);
  }
  const facade::PoolNode* node = pool.find(fault.node.number());
  return node != nullptr && node->role != nullptr &&
         (node->worker != nullptr || static_cast<std::size_t>(fault.stage) < boundary_stage_count);
}

Status World::inject(const Fault& fault) try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return Status::out_of_memory;
  }
  if (w.frame_is_running()) {
    return w.refuse(Status::out_of_order);
  }
  if (!w.can_fail(fault)) {
    return w.refuse(Status::bad_number);
  }
  if (fault.user != no_user) {
    facade::User& user = *w.user_nodes.at(fault.user.number());
    w.user_threads[user.thread]->worker->assign({});
    user.role->fail(fault);
    w.assign_users();
    return Status::ok;
  }
  // The node's thread must not step the role meanwhile.
  const facade::PoolNode& node = *w.pool.find(fault.node.number());
  nodes::CdNodeRole& role = *node.role;
  if (Worker* worker = node.worker.get()) {
    worker->assign({});
    role.fail(fault);
    worker->assign({Steppable::of(role)});
  } else {
    w.server_worker->assign({Steppable::of(*w.server)});
    role.fail(fault);
    w.server_worker->assign(w.server_thread_roles());
  }
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

void World::fail_thread_creation(std::uint32_t succeed_first) noexcept {
  implementation_->threads_until_failure = succeed_first;
}

std::uint32_t World::release_faults() noexcept {
  Implementation& w = *implementation_;
  const std::uint32_t stopped = w.faults.release();
  w.pool.each_worker([](Worker& worker) { worker.bell().ring(); });
  return stopped;
}

}  // namespace ringfence
