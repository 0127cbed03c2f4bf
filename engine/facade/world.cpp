#include "ringfence/world.hpp"

#include <algorithm>
#include <new>
#include <string>
#include <utility>

#include "base/floating_point.hpp"
#include "facade/implementation.hpp"

namespace ringfence {

using telemetry::StepClock;
using telemetry::to_ms;

Status World::Implementation::check_spec(const ObjectSpec& spec) const noexcept {
  if (!shapes.has(spec.shape.number())) {
    return Status::unknown_shape;
  }
  if (const Status status = check_layer(spec.layer); status != Status::ok) {
    return status;
  }
  const bool avatar = spec.category == Category::avatar;
  if (static_cast<std::size_t>(spec.category) > static_cast<std::size_t>(Category::fixed) ||
      avatar != (spec.user != no_user)) {
    return Status::bad_category;
  }
  if (avatar && !is_connected(spec.user.number())) {
    return Status::unknown_user;
  }
  if (spec.number != 0 && registry.in_use(spec.number)) {
    return Status::number_in_use;
  }
  if (avatar && config.quotas.avatars != 0 && registry.avatars(spec.user.number()) >= config.quotas.avatars) {
    return Status::over_quota;
  }
  return registry.live() >= config.limits.objects ? Status::over_capacity : Status::ok;
}

void World::Implementation::gather_user_times() {
  report.users_cpu_ms = report.slowest_user_cpu_ms = 0;
  if (!threaded()) {
    report.path = {};
    return;
  }
  PathReport& path = report.path;
  for (const auto& thread : user_threads) {
    const std::uint64_t cpu_ns = thread->worker->cpu_ns();
    const std::uint64_t all_ns = cpu_ns - std::exchange(thread->cpu_ns, cpu_ns);
    const std::uint64_t move_ns = std::min(all_ns, thread->clock.take(StepClock::move));
    const std::uint64_t read_ns = std::min(all_ns - move_ns, thread->clock.take(StepClock::read_publications));
    report.users_cpu_ms += to_ms(all_ns);
    report.slowest_user_cpu_ms = std::max(report.slowest_user_cpu_ms, to_ms(all_ns));
    path.user_move_ms = std::max(path.user_move_ms, to_ms(move_ns));
    path.user_read_ms = std::max(path.user_read_ms, to_ms(read_ns));
    path.user_end_ms = std::max(path.user_end_ms, to_ms(all_ns - move_ns - read_ns));
  }
}

void World::Implementation::gather_timeline() {
  report.timeline.clear();
  if (!config.timeline) {
    return;
  }
  std::uint32_t index = 0;
  const auto gather = [&](telemetry::Track* track) {
    for (TimelineSpan span : track != nullptr ? track->spans() : std::span<const TimelineSpan>()) {
      span.track = index;
      report.timeline.push_back(span);
    }
    if (track != nullptr) {
      track->clear();
    }
    ++index;
  };
  gather(&server_track);
  // The thread of a lost node may still write its track.
  pool.each([&](const facade::PoolNode& node) { gather(is_lost(node.id) ? nullptr : node.track.get()); });
  for (const auto& thread : user_threads) {
    gather(&thread->track);
  }
}

bool World::Implementation::is_lost(NodeNumber id) const noexcept {
  return std::find(report.lost.begin(), report.lost.end(), NodeId(id)) != report.lost.end();
}

void World::Implementation::log_growth() {
  if (report.grown != 0 && !growth_logged) {
    growth_logged = true;
    log(LogLevel::warning, "frame " + std::to_string(report.frame) +
                               " outgrew what was reserved: " + std::to_string(report.objects) + " objects, " +
                               std::to_string(report.candidates) + " pairs, " + std::to_string(report.contacts) +
                               " contacts; raise WorldConfig::capacities to keep frames free of allocations");
  }
}

void World::Implementation::log_support_failures() {
  for (const std::string& failure : shapes.take_support_failures()) {
    log(LogLevel::warning, failure + "; pairs for which it fails have no contact, see FrameReport::failed_supports");
  }
  if (config.remote_nodes != nullptr && report.failed_supports != 0 && !failures_logged) {
    failures_logged = true;
    log(LogLevel::warning, "frame " + std::to_string(report.frame) + ": " + std::to_string(report.failed_supports) +
                               " pairs have no contact, since a support function failed on a CD node; see its log");
  }
}

// The roles wait. Those whose threads may still run, because they are lost or late, are left out.
void World::Implementation::gather_model_failures() {
  std::vector<ModelFailure> remote;
  if (config.remote_nodes != nullptr) {
    remote = config.remote_nodes->take_model_failures();
  }
  if (report.refused[static_cast<std::size_t>(Status::model_failed)] == 0) {
    return;
  }
  nodes::ModelFailures all = server->model_failures();
  pool.each([&](const facade::PoolNode& node) {
    if (node.role != nullptr && !is_lost(node.id)) {
      all.add(node.role->host().failures().span());
    }
  });
  for (const auto& [number, user] : user_nodes) {
    if (!user->late) {
      all.add(user->role->host().failures().span());
    }
  }
  all.add(remote);
  report.model_failures.assign(all.span().begin(), all.span().end());
  constexpr std::uint32_t max_logged = 100;
  for (const ModelFailure& failure : report.model_failures) {
    if (model_failures_logged < max_logged) {
      log(LogLevel::warning, "frame " + std::to_string(report.frame) + ": the motion model threw for object " +
                                 std::to_string(failure.object.number()) + ": " + failure.text +
                                 (++model_failures_logged == max_logged ? "; further failures are not logged" : ""));
    }
  }
}

World::World(WorldConfig config) {
  const base::DefaultFloatingPoint floating_point;
  implementation_ = std::make_unique<Implementation>(std::move(config));
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
  if (implementation_->frame_is_running() && !implementation_->halt.is_set()) {
    (void)finish_frame();  // its results are not read
  }
}

const WorldConfig& World::config() const noexcept { return implementation_->config; }

std::uint32_t World::nodes() const noexcept {
  const Implementation& w = *implementation_;
  return static_cast<std::uint32_t>(w.frames == 0 ? w.pool.size() : w.report.nodes.size());
}

std::optional<NodeId> World::node_at(const Vec3d& position) const noexcept {
  const Implementation& w = *implementation_;
  if (w.frame_is_running()) {
    return {};
  }
  std::uint32_t point[3];
  w.space.point(position, point);
  const facade::PoolNode* node = w.pool.at(w.server->map().owner_at(point));
  return node == nullptr ? std::optional<NodeId>() : NodeId(node->id);
}

Status World::advance() {
  const Status status = begin_frame();
  return status == Status::ok ? finish_frame() : status;
}

Status World::begin_frame() try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return w.stop_frames();
  }
  if (w.frame_is_running()) {
    return w.refuse(Status::out_of_order);
  }
  w.registry.cut();
  w.cut_leaving.swap(w.leaving);
  w.order.requests.swap(w.requests);
  w.order.states.swap(w.states);
  w.connect_users();
  w.resize_nodes();
  for (const auto& pending_move : w.pending_moves) {
    w.user_nodes.at(pending_move.user)->role->steer(pending_move.number, pending_move.pose);
  }
  w.pending_moves.clear();
  for (const auto& pending_input : w.pending_inputs) {
    w.user_nodes.at(pending_input.user)->role->give_input(pending_input.input);
  }
  w.pending_inputs.clear();
  w.order.users_overdue.store(false, std::memory_order_relaxed);  // may remain set from the frame before
  ++w.begun;
  w.order.ordered.store(w.begun, std::memory_order_release);
  if (w.threaded()) {
    w.server_worker->bell().ring();
  }
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

Status World::finish_frame() try {
  const base::DefaultFloatingPoint floating_point;
  Implementation& w = *implementation_;
  if (w.halt.is_set()) {
    return w.stop_frames();
  }
  if (!w.frame_is_running()) {
    return w.refuse(Status::out_of_order);
  }
  if (w.threaded() ? !w.await_frame() : !w.step_inline()) {
    return w.stop_frames();
  }
  ++w.frames;
  w.order.requests.clear();
  w.order.states.clear();
  w.registry.forget_cut();
  w.forget_users();

  w.report = w.server->report(w.frames - 1);
  for (std::size_t reason = 0; reason < status_count; ++reason) {
    w.report.refused[reason] += std::exchange(w.refused[reason], 0);
  }
  w.part_with_late_users();
  w.gather_model_failures();
  w.gather_user_times();
  w.gather_timeline();
  w.free_stalled_users();
  w.remove_gone_nodes();
  if (w.pool.free_retired()) {
    w.server->free_abandoned();
    w.shapes.free_removed();
  }
  for (const UserId user : w.report.late) {
    if (w.is_connected(user.number())) {
      (void)disconnect(user);  // is connected
    }
  }
  w.log_losses();
  w.log_growth();
  w.log_support_failures();
  return Status::ok;
} catch (const std::bad_alloc&) {
  return implementation_->stop_frames();
}

std::uint64_t World::frames() const noexcept { return implementation_->frames; }

std::span<const Contact> World::contacts() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().contacts(w.frames - 1);
}

std::span<const Contact> World::ended() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().ended(w.frames - 1);
}

std::span<const Contact> World::collisions_of(UserId user) const noexcept {
  const Implementation& w = *implementation_;
  const auto at = w.user_nodes.find(user.number());
  return w.frames == 0 || at == w.user_nodes.end() || at->second->late ? std::span<const Contact>{}
                                                                       : at->second->role->contacts(w.frames - 1);
}

ObjectContacts World::collisions_of(ObjectId object) const {
  const Implementation& w = *implementation_;
  if (w.registry.find(object) == nullptr || w.frames == 0) {
    return {};
  }
  if (w.indexed_frames != w.frames) {
    w.contact_index.build(contacts());
    w.indexed_frames = w.frames;
  }
  return {contacts().data(), w.contact_index.of(object.number())};
}

std::span<const std::span<const SeenState>> World::seen_by(UserId user) const noexcept {
  const Implementation& w = *implementation_;
  const auto at = w.user_nodes.find(user.number());
  if (w.frames == 0 || at == w.user_nodes.end() || at->second->late) {
    return {};
  }
  return at->second->role->seen(w.frames - 1);
}

namespace {

ObjectView view_of(const nodes::ServerRole& server, std::uint32_t slot) {
  const nodes::ObjectTable& objects = server.objects();
  const nodes::ObjectRow& row = objects.row(slot);
  const nodes::ObjectOrigin& origin = objects.origin(slot);
  ObjectView view;
  view.id = ObjectId::of(row.object.number, row.object.generation);
  view.spec = {row.object.number,
               ShapeId(row.shape),
               static_cast<Category>(row.category),
               static_cast<std::uint8_t>(row.layer),
               server.objects().group(slot),
               (row.object.flags & messages::flag_present) != 0,
               UserId(origin.user),
               origin.user_data,
               server.pose(slot)};
  return view;
}

}  // namespace

std::uint32_t World::Implementation::slot_of(ObjectId object) const noexcept {
  if (frame_is_running() || registry.find(object) == nullptr) {
    return base::NumberIndex::none;
  }
  const nodes::ObjectTable& table = server->objects();
  const std::uint32_t slot = table.find(object.number());
  const bool there = slot != base::NumberIndex::none && table.row(slot).object.generation == object.generation();
  return there ? slot : base::NumberIndex::none;
}

ObjectView World::object(ObjectId object) const noexcept {
  const std::uint32_t slot = implementation_->slot_of(object);
  return slot == base::NumberIndex::none ? ObjectView{} : view_of(*implementation_->server, slot);
}

std::span<const std::byte> World::state(ObjectId object) const noexcept {
  const Implementation& w = *implementation_;
  const std::uint32_t slot = w.config.motion == nullptr ? base::NumberIndex::none : w.slot_of(object);
  if (slot == base::NumberIndex::none) {
    return {};
  }
  return {w.server->state(slot), w.config.motion->state_bytes()};
}

std::vector<ObjectView> World::objects() const {
  const Implementation& w = *implementation_;
  std::vector<ObjectView> views;
  if (w.frame_is_running()) {
    return views;
  }
  const nodes::ObjectTable& table = w.server->objects();
  views.reserve(table.live());
  for (std::uint32_t slot = 0; slot < table.slots(); ++slot) {
    if (table.alive(slot)) {
      views.push_back(view_of(*w.server, slot));
    }
  }
  std::sort(views.begin(), views.end(),
            [](const ObjectView& p, const ObjectView& q) { return p.spec.number < q.spec.number; });
  return views;
}

ObjectId World::find(ObjectNumber number) const noexcept { return implementation_->registry.find(number); }

const ShapeDescription& World::shape(ShapeId shape) const noexcept {
  return implementation_->shapes.description(shape.number());
}

bool World::has_shape(ShapeId shape) const noexcept { return implementation_->shapes.has(shape.number()); }

std::size_t World::shape_count() const noexcept { return implementation_->shapes.size(); }

const FrameReport& World::report() const noexcept { return implementation_->report; }

}  // namespace ringfence
