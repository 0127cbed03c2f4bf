#include "soak/soak.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <set>
#include <span>
#include <string>

#include <fmt/format.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t max_soak_nodes = 8;
constexpr std::size_t max_users = 200;
constexpr std::size_t max_shapes = 500;
constexpr double far = 1e15 - 8;  // metres: almost as far away as an object may be
constexpr double far_site = 4;    // metres around a place there, so that some of them touch

}  // namespace

Soak::Soak(World& world, const worlds::Scene& scene, std::uint64_t seed) : world_(world), scene_(scene), random_(seed) {
  std::set<std::uint32_t> users;
  for (const ObjectView& object : world.objects()) {
    const ObjectSpec& spec = object.spec;
    live_.push_back({object.id, spec.category, spec.user});
    if (spec.category != Category::fixed) shapes_.push_back(spec.shape);
    if (spec.category == Category::avatar) users.insert(spec.user.number());
  }
  for (const std::uint32_t user : users) users_.emplace_back(user);
  note_late_users(world.report());
}

// They are disconnected at the next cut.
void Soak::note_late_users(const FrameReport& report) {
  counts_.late += report.late.size();
  for (const UserId user : report.late) remove_user(user);
}

void Soak::make_requests() {
  const std::size_t target = scene_.objects.size();
  for (std::uint64_t n = random_() % 6; n > 0 && live_.size() < target + target / 10; --n) spawn(no_user);
  for (std::uint64_t n = random_() % 6; n > 0 && live_.size() > target - target / 10; --n) destroy();
  for (std::uint64_t n = random_() % 4; n > 0 && !live_.empty(); --n) {
    const Live& object = live_[random_() % live_.size()];
    if (object.category == Category::fixed) continue;
    if (object.category == Category::avatar) give_input(object);
    if (one_in(4)) {
      counts_.disabled += world_.set_enabled(object.id, false) == Status::ok ? 1 : 0;
    } else if (one_in(4)) {
      counts_.enabled += world_.set_enabled(object.id, true) == Status::ok ? 1 : 0;
    } else {
      counts_.placed += world_.place(object.id, random_pose()) == Status::ok ? 1 : 0;
    }
  }
  for (std::uint64_t n = random_() % 4; n > 0 && !live_.empty(); --n) change(live_[random_() % live_.size()]);
  change_users();
  if (one_in(100) && !users_.empty()) flood(users_[random_() % users_.size()]);
  change_nodes();
  if (retired_shape_ || one_in(50)) remove_shape();
  if (one_in(25) || (lost_last_ && one_in(2))) add_shape();
  if (one_in(3)) make_invalid_calls();
}

bool Soak::check_report(const FrameReport& report) {
  bool passed = report.accepted == report.candidates && report.tested + report.carried == report.candidates;
  if (!passed) {
    fmt::print(stderr, "frame {}: {} candidates, {} tested, {} carried over, {} accepted\n", report.frame,
               report.candidates, report.tested, report.carried, report.accepted);
  }
  // If nodes were lost since the resize, the injected failure to create a thread may also occur when the frame begins.
  const auto no_thread = static_cast<std::size_t>(Status::no_thread);
  if (thread_failure_pending_ && report.refused[no_thread] == expected_[no_thread] + 1) {
    thread_failure_pending_ = false;
    ++counts_.without_thread;
    ++expected_[no_thread];
  }
  for (std::size_t reason = 0; reason < status_count; ++reason) {
    // Messages of a lost node that still runs are refused as `late`. Their number is not predictable.
    if (reason == static_cast<std::size_t>(Status::late) || report.refused[reason] == expected_[reason]) continue;
    passed = false;
    fmt::print(stderr, "frame {}: {} refused as {}; expected {}\n", report.frame, report.refused[reason],
               name_of(static_cast<Status>(reason)), expected_[reason]);
  }
  expected_.fill(0);
  counts_.lost += report.lost.size();
  lost_last_ = !report.lost.empty();
  note_late_users(report);
  counts_.failures += passed ? 0 : 1;
  return passed;
}

Pose Soak::random_pose() {
  if (one_in(50)) {
    std::uniform_real_distribution<double> around(-far_site, far_site);
    const double side = one_in(2) ? far : -far;
    return {{side + around(random_), side + around(random_), around(random_)}, {}};
  }
  std::uniform_real_distribution<double> unit(-0.02, 1.02);  // also outside the bounds
  const Vec3d &low = scene_.bounds_min, &high = scene_.bounds_max;
  const auto between = [&](double from, double to) { return from + (to - from) * unit(random_); };
  return {{between(low.x, high.x), between(low.y, high.y), between(low.z, high.z)}, {}};
}

void Soak::spawn(UserId user) {
  if (shapes_.empty()) return;
  ObjectSpec spec;
  spec.shape = shapes_[random_() % shapes_.size()];
  spec.category = user != no_user ? Category::avatar : one_in(3) ? Category::non_active : Category::active;
  spec.user = user;
  spec.pose = random_pose();
  const Spawned spawned = world_.spawn(spec);
  if (spawned.status == Status::over_quota) {
    ++expected_[static_cast<std::size_t>(spawned.status)];
    return;
  }
  if (spawned.status != Status::ok) throw Error(fmt::format("--soak: spawn returned {}", name_of(spawned.status)));
  live_.push_back({spawned.id, spec.category, user});
  ++counts_.spawned;
}

/// A user that makes avatars until its quota is used up.
void Soak::flood(UserId user) {
  const std::size_t most = world_.config().quotas.spawns;
  if (most == 0 || shapes_.empty()) return;
  ++counts_.floods;
  for (std::size_t n = 0; n <= most; ++n) {
    ObjectSpec spec;
    spec.shape = shapes_[random_() % shapes_.size()];
    spec.category = Category::avatar;
    spec.user = user;
    spec.pose = random_pose();
    const Spawned spawned = world_.spawn(spec);
    if (spawned.status == Status::over_quota) {
      ++expected_[static_cast<std::size_t>(Status::over_quota)];
      ++counts_.refused;
      return;
    }
    counts_.failures += spawned.status == Status::ok ? 0 : 1;
    if (spawned.status != Status::ok) return;
    live_.push_back({spawned.id, spec.category, user});
    ++counts_.spawned;
  }
  ++counts_.failures;  // the quota did not end it
}

void Soak::give_input(const Live& avatar) {
  std::byte bytes[max_input_bytes];
  std::generate(std::begin(bytes), std::end(bytes), [this] { return static_cast<std::byte>(random_()); });
  const std::span input(bytes, random_() % (max_input_bytes + 1));
  counts_.inputs += world_.input(avatar.user, avatar.id, input) == Status::ok ? 1 : 0;
}

void Soak::destroy() {
  const std::size_t at = random_() % live_.size();
  if (live_[at].category == Category::fixed || world_.destroy(live_[at].id) != Status::ok) return;
  destroyed_id_ = live_[at].id;
  live_[at] = live_.back();
  live_.pop_back();
  ++counts_.destroyed;
}

void Soak::remove_user(UserId user) {
  std::erase_if(live_, [user](const Live& object) { return object.user == user; });
  std::erase(users_, user);
}

void Soak::change(const Live& object) {
  const std::uint64_t draw = random_();
  const std::span<const std::byte> state = world_.state(object.id);
  const std::size_t layers = std::max<std::size_t>(1, world_.config().layers.names.size());
  Status status = Status::ok;
  if (draw % 4 == 0) status = world_.set_group(object.id, static_cast<std::uint32_t>(draw / 4 % 3));
  if (draw % 4 == 1) status = world_.set_layer(object.id, static_cast<std::uint8_t>(draw / 4 % layers));
  if (draw % 4 == 2 && !shapes_.empty()) status = world_.set_shape(object.id, shapes_[draw / 4 % shapes_.size()]);
  if (draw % 4 == 3 && !state.empty() && object.category != Category::fixed) {
    status = world_.set_state(object.id, std::vector<std::byte>(state.begin(), state.end()));
  }
  counts_.changed += status == Status::ok ? 1 : 0;
  counts_.failures += status == Status::ok ? 0 : 1;
}

// All objects get another shape, then the shape is removed. It is refused as long as an object has it, also one that is
// not in the world yet.
void Soak::remove_shape() {
  if (!retired_shape_) {
    const ShapeId shape = shapes_.empty() ? ShapeId() : shapes_[random_() % shapes_.size()];
    if (std::count(shapes_.begin(), shapes_.end(), shape) == std::ssize(shapes_)) return;  // the only one
    retired_shape_ = shape;
    std::erase(shapes_, shape);
  }
  for (const Live& object : live_) {
    const ObjectView view = world_.object(object.id);
    if (!view.id || view.spec.shape != *retired_shape_) continue;
    counts_.failures += world_.set_shape(object.id, shapes_[random_() % shapes_.size()]) == Status::ok ? 0 : 1;
  }
  const Status status = world_.remove_shape(*retired_shape_);
  if (status == Status::shape_in_use) {
    ++expected_[static_cast<std::size_t>(status)];
    return;
  }
  counts_.failures += status == Status::ok ? 0 : 1;
  ++counts_.shapes_removed;
  retired_shape_.reset();
}

// Also called while lost nodes still run and read the earlier shapes.
void Soak::add_shape() {
  if (world_.shape_count() == max_shapes) return;
  shapes_.push_back(world_.add_shape(Sphere{0.5f + 0.001f * static_cast<float>(random_() % 1000)}));
  ++counts_.shapes;
}

void Soak::change_users() {
  if ((one_in(40) && users_.size() < max_users) || users_.size() < 2) {
    if (const Connected connected = world_.connect(); connected.status == Status::ok) {
      users_.push_back(connected.user);
      spawn(connected.user);
      ++counts_.connected;
    }
  }
  if (one_in(40) && users_.size() > 1) {
    const UserId user = users_[random_() % users_.size()];
    if (world_.disconnect(user) == Status::ok) {
      remove_user(user);
      ++counts_.disconnected;
    }
  }
}

void Soak::change_nodes() {
  if (world_.config().nodes == 0) return;
  if (one_in(40)) resize();
  if (one_in(25)) stop_node();
  if (one_in(50)) stop_user();
  // Nodes that were stopped without a time limit continue, and their memory is freed.
  if (one_in(30)) counts_.released += world_.release_faults();
}

void Soak::resize() {
  if (one_in(4)) {
    world_.fail_thread_creation(static_cast<std::uint32_t>(random_() % 4));
    thread_failure_pending_ = true;
  }
  const Status status = world_.resize(1 + static_cast<std::uint32_t>(random_() % max_soak_nodes));
  if (status == Status::no_thread && thread_failure_pending_) {
    thread_failure_pending_ = false;
    ++counts_.without_thread;
    ++expected_[static_cast<std::size_t>(status)];
  } else {
    counts_.resizes += status == Status::ok ? 1 : 0;
    counts_.failures += status == Status::ok ? 0 : 1;
  }
}

void Soak::stop_node() {
  const std::vector<NodeReport>& nodes = world_.report().nodes;
  Fault fault;
  fault.node = nodes[random_() % nodes.size()].id;
  fault.frame = world_.frames();
  fault.stage = static_cast<NodeStage>(random_() % node_stage_count);
  fault.stall_ms = one_in(2) ? 0 : 2 * world_.config().deadlines.node_ms;
  fault.passes = static_cast<std::uint32_t>(random_() % 3);
  // Without a time limit all nodes would be lost with one that stops inside a gate.
  if (fault.stage == NodeStage::gate) fault.stall_ms = 2 * world_.config().deadlines.node_ms;
  inject(fault);
}

void Soak::stop_user() {
  Fault fault;
  fault.user = users_[random_() % users_.size()];
  fault.frame = world_.frames();
  fault.stage = one_in(2) ? NodeStage::model : NodeStage::publication;
  fault.stall_ms = one_in(2) ? 0 : 2 * world_.config().deadlines.user_ms;
  inject(fault);
}

void Soak::inject(const Fault& fault) {
  const Status status = world_.inject(fault);
  counts_.faults += status == Status::ok ? 1 : 0;
  expected_[static_cast<std::size_t>(status)] += status == Status::ok ? 0 : 1;
}

void Soak::expect(Status got, Status reason) {
  ++expected_[static_cast<std::size_t>(reason)];
  ++counts_.refused;
  counts_.failures += got == reason ? 0 : 1;
}

/// Makes calls that the world must refuse.
void Soak::make_invalid_calls() {
  Pose not_finite_pose;
  not_finite_pose.position.x = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 20; ++i) {
    const Live& object = live_[random_() % live_.size()];
    expect(world_.destroy(ObjectId{}), Status::stale_object);
    if (destroyed_id_) expect(world_.place(destroyed_id_, {}), Status::stale_object);
    if (object.category != Category::fixed) expect(world_.place(object.id, not_finite_pose), Status::not_finite);
    const UserId user = users_[random_() % users_.size()];
    if (object.user != user) expect(world_.move(user, object.id, {}), Status::not_host);
    if (object.user != user) expect(world_.input(user, object.id, {}), Status::not_host);
    expect(world_.spawn({.shape = ShapeId(0xffffff)}).status, Status::unknown_shape);
    expect(world_.resize(0), Status::bad_number);
  }
}

}  // namespace ringfence::tools
