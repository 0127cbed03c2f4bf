#include "facade/implementation.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "facade/results/gathering.hpp"
#include "facade/results/object_views.hpp"
#include "facade/save/restore.hpp"

namespace ringfence {

// The nodes are made before the server, which is given their connections.
World::Implementation::Implementation(WorldConfig given, std::uint64_t first_frame)
    : state(std::move(given), first_frame),
      requests(state.config, state.shapes),
      begun(first_frame),
      frames(first_frame),
      frame_store(state.shared_shapes, state.config.history),
      sensed_frames(state.shared_shapes, state.config.sense),
      batches(state.shared_shapes),
      users(state),
      nodes(state),
      membership(state, nodes, requests) {
  state.start_server_thread();
  const regions::RegionMap map = state.first_map();
  nodes::ServerSetup setup = state.server_setup();
  setup.nodes = nodes.make_first(map);
  server = std::make_unique<nodes::ServerRole>(setup, map);
  nodes.connect(*server);
  users.start_threads();
}

World::Implementation::Implementation(WorldConfig given, const facade::SavedWorld& saved)
    : Implementation(facade::config_for(std::move(given), saved), saved.frames) {
  own = saved.own;
  restore_shapes(saved);
  facade::restore_requests(saved, requests);
  if (frames > 0) {
    facade::restore_objects(saved, *server);
  }
}

// The numbers of removed shapes are not used again.
void World::Implementation::restore_shapes(const facade::SavedWorld& saved) {
  for (const ShapeDescription* const shape : saved.shapes) {
    if (shape != nullptr) {
      (void)add_shape(*shape);
    } else {
      remove_shape(add_shape(Sphere{0.5f}));
    }
  }
  state.shapes.free_removed();
  shape_changes.clear();
}

void World::Implementation::apply(const facade::RecordedInputs& inputs) {
  for (const auto& [shape, description] : inputs.added) {
    if (shape >= state.shapes.size() && add_shape(description) != shape) {
      throw Error("apply: the frame adds shape " + std::to_string(shape) + ", and the world has " +
                  std::to_string(state.shapes.size() - 1) + ": restore it from a snapshot of this journal");
    }
  }
  facade::apply_inputs(inputs, state, requests);
  for (const ShapeNumber shape : inputs.removed) {
    if (state.shapes.has(shape) && !requests.objects().uses(shape)) {
      remove_shape(shape);
    }
  }
}

bool World::Implementation::record(World& world) {
  const bool recorded =
      state.config.recorder->begin_frame(world, facade::record_inputs(state, requests, shape_changes));
  shape_changes.clear();
  unrecorded = !recorded;
  return recorded;
}

// What a frame depends on beside state and inputs: whether a user node was in time, and exceptions of the model.
bool World::Implementation::acknowledge(World& world) {
  const bool reproducible = report.late.empty() && report.refused[static_cast<std::size_t>(Status::model_failed)] == 0;
  unrecorded = !state.config.recorder->finish_frame(world, reproducible);
  return !unrecorded;
}

ShapeNumber World::Implementation::add_shape(const ShapeDescription& description) {
  geometry::ShapeTable& shapes = state.shapes;
  const ShapeNumber shape = shapes.add(description);
  if (state.config.remote_nodes != nullptr) {
    state.config.remote_nodes->add_shape(shape, description);
  }
  if (shapes.row(shape).kind == ShapeKind::mesh) {
    state.log.log_dropped_triangles(shape, shapes.mesh(shapes.row(shape).index_in_kind));
  }
  if (state.config.recorder != nullptr) {
    shape_changes.added.push_back(shape);
  }
  return shape;
}

void World::Implementation::remove_shape(ShapeNumber shape) {
  state.shapes.remove(shape, frames);
  if (state.config.recorder != nullptr) {
    shape_changes.removed.push_back(shape);
  }
  if (state.config.remote_nodes != nullptr) {
    state.config.remote_nodes->remove_shape(shape);
  }
}

// All threads end before any is freed: until then each may ring the doorbell of any other.
World::Implementation::ThreadStopper::~ThreadStopper() {
  world.state.faults.release();
  const auto each_worker = [this](auto visit) {
    world.users.each_worker(visit);
    world.nodes.pool().each_worker(visit);
    if (world.state.server_worker != nullptr) {
      visit(*world.state.server_worker);
    }
  };
  each_worker([](facade::Worker& worker) { worker.dismiss(); });
  each_worker([](facade::Worker& worker) { worker.join(); });
  if (world.state.config.remote_nodes != nullptr) {
    world.state.config.remote_nodes->close();
  }
}

bool World::Implementation::inject(const Fault& fault) {
  if (!state.threaded() || fault.frame < begun || !std::isfinite(fault.stall_ms) || fault.stall_ms < 0 ||
      static_cast<std::size_t>(fault.stage) >= node_stage_count) {
    return false;
  }
  return fault.user != no_user ? users.inject(fault) : nodes.inject(fault, *server);
}

const nodes::UserRole* World::Implementation::reader(UserId user) const noexcept {
  const facade::User* found = frames == 0 ? nullptr : users.find(user.number());
  return found == nullptr || found->late ? nullptr : &found->role;
}

std::uint32_t World::Implementation::slot_of(ObjectId object) const noexcept {
  const bool known = !frame_is_running() && requests.objects().find(object) != nullptr;
  return known ? facade::slot_of(*server, object) : base::NumberIndex::none;
}

void World::Implementation::order_frame() {
  state.order.users_overdue.store(false, std::memory_order_relaxed);  // may remain set from the frame before
  ++begun;
  // Pairs with the server's acquire load: the requests are complete.
  state.order.ordered.store(begun, std::memory_order_release);
  if (state.threaded()) {
    state.server_bell()->ring();
  }
}

bool World::Implementation::await_frame() {
  nodes::FrameOrder& order = state.order;
  if (!state.threaded()) {
    return state.inline_roles.step_until(order.completed, begun);
  }
  const auto is_complete = [&] { return order.completed.load(std::memory_order_acquire) == begun; };
  while (!is_complete()) {
    state.caller_bell.wait([&] {
      return is_complete() || order.fallback_wanted.load(std::memory_order_acquire) ||
             order.users_overdue.load(std::memory_order_acquire) || state.halt.is_set();
    });
    if (state.halt.is_set()) {
      return false;
    }
    if (order.fallback_wanted.exchange(false, std::memory_order_acquire)) {
      nodes.replace_last(*server);
    }
    if (order.users_overdue.exchange(false, std::memory_order_acquire)) {
      users.replace_stalled_threads();
    }
  }
  return true;
}

void World::Implementation::take_report() {
  report = server->report(frames - 1);
  requests.report_refused(report);
}

void World::Implementation::complete_report() {
  facade::gather_model_failures(report, state, *server, nodes, users);
  users.report_times(report);
  facade::gather_timeline(report, state, nodes, users);
}

void World::Implementation::free_gone_roles() {
  users.free_stalled();
  membership.remove_gone(report, *server);
  sensed_frames.finish(!report.lost.empty() || !report.late.empty());
  if (nodes.pool().free_retired()) {
    server->free_abandoned();
    batches.free_abandoned();
    if (sensed_frames.has_abandoned() && !users.has_stalled()) {
      sensed_frames.free_abandoned();
    }
    // A model may read shapes, also in a stalled thread.
    if (!sensed_frames.has_abandoned()) {
      state.shapes.free_removed(frame_store.drop_obsolete());
    }
  }
}

void World::Implementation::log_frame() {
  const bool remote_nodes = state.config.remote_nodes != nullptr;
  state.log.log_model_failures(report);
  state.log.log_losses(report, nodes.pool().size(), server->has_abandoned_nodes());
  state.log.log_growth(report);
  state.log.log_support_failures(state.shapes.take_support_failures(), report, remote_nodes);
}

Status World::Implementation::stop_frames() noexcept {
  state.halt.set();
  state.log.log_halt(begun - (frame_is_running() ? 1 : 0));
  return Status::out_of_memory;
}

}  // namespace ringfence
