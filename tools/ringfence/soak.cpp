#include "soak.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include <fmt/format.h>
#include <malloc.h>

#include "exit_code.hpp"
#include "frame_checker.hpp"
#include "progress.hpp"
#include "ringfence/error.hpp"
#include "stop_signals.hpp"
#include "worlds/load.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t max_nodes = 8;
constexpr std::size_t max_users = 200;
constexpr std::uint32_t frames_per_check = 16;  ///< one frame in 16 is compared with brute force
constexpr double default_deadline_ms = 250;
constexpr std::size_t max_shapes = 500;

/// Bytes that the process has allocated.
std::uint64_t allocated_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// Bytes that the process has allocated with `nodes` CD nodes, so that two values can be compared. Runs four frames and
/// adds them to `frames`.
std::uint64_t allocated_with(World& world, FrameChecker& checker, std::uint32_t nodes, std::uint64_t& frames) {
  world.release_faults();
  // An injected failure to create a thread occurs once.
  Status status = nodes == 0 ? Status::ok : world.resize(nodes);
  if (status == Status::no_thread) status = world.resize(nodes);
  if (status != Status::ok) throw Error(fmt::format("--soak: resize returned {}", name_of(status)));
  for (int i = 0; i < 4; ++i) {
    advance(world, ++frames);
    checker.skip_frame();
  }
  return allocated_bytes();
}

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

}  // namespace

Soak::Soak(World& world, const worlds::Scene& scene, std::uint64_t seed) : world_(world), scene_(scene), random_(seed) {
  for (const ObjectSpec& object : scene.objects) {
    live_.push_back({world.find(object.number), object.category, object.user});
    if (object.category != Category::fixed) shapes_.push_back(object.shape);
  }
  for (std::uint32_t user = 0; user < worlds::users_of(scene); ++user) users_.emplace_back(user);
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
  change_nodes();
  if (retired_shape_ || one_in(50)) remove_shape();
  if (one_in(25) || (lost_last_ && one_in(2))) add_shape();
  if (one_in(3)) make_invalid_calls();
}

bool Soak::check_report(const FrameReport& report) {
  bool passed = report.accepted == report.candidates && report.tested == report.candidates;
  if (!passed) {
    fmt::print(stderr, "frame {}: {} candidates, {} tested, {} accepted\n", report.frame, report.candidates,
               report.tested, report.accepted);
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
  counts_.late += report.late.size();
  std::for_each(report.late.begin(), report.late.end(), [this](UserId user) { remove_user(user); });
  counts_.failures += passed ? 0 : 1;
  return passed;
}

Pose Soak::random_pose() {
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
  if (spawned.status != Status::ok) throw Error(fmt::format("--soak: spawn returned {}", name_of(spawned.status)));
  live_.push_back({spawned.id, spec.category, user});
  ++counts_.spawned;
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
  const Status status = world_.resize(1 + static_cast<std::uint32_t>(random_() % max_nodes));
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

int run_soak(const Job& job, double minutes, std::uint64_t seed) {
  Job longer = job;
  if (longer.service.deadlines.node_ms == 0) longer.service.deadlines.node_ms = default_deadline_ms;
  if (longer.service.deadlines.user_ms == 0) longer.service.deadlines.user_ms = 2 * default_deadline_ms;
  WorldConfig config = world_config(longer);
  config.log = nullptr;  // nodes are lost on purpose
  World world(config);
  worlds::load_into(world, longer.scene, longer.service.users);
  FrameChecker checker(world, longer.output.check);
  advance(world, 0);
  checker.skip_frame();
  Soak soak(world, longer.scene, seed);

  const StopSignals stop;
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  const auto elapsed_share = [&] {
    return std::chrono::duration<double>(Clock::now() - begin).count() / (60 * minutes);
  };
  constexpr std::uint64_t steps = 1000;
  Progress progress(longer.output.quiet, steps);
  std::uint64_t shown = 0, frames = 0, contacts = 0;
  std::optional<std::uint64_t> settled_bytes;  // 0 under sanitizers, which have their own allocator
  double slowest_ms = 0;
  for (double share = 0; share < 1 && !stop.received(); share = elapsed_share()) {
    if (!settled_bytes && share > 0.1) {
      settled_bytes = allocated_with(world, checker, longer.service.nodes, frames);
    }
    soak.make_requests();
    advance(world, ++frames);
    soak.check_report(world.report());
    contacts += world.contacts().size();
    slowest_ms = std::max(slowest_ms, world.report().frame_ms);
    if (frames % frames_per_check == 0) {
      checker.check_frame(frames);
    } else {
      checker.skip_frame();
    }
    for (; shown < static_cast<std::uint64_t>(share * steps); ++shown) progress.step();
  }
  progress.finish();

  const double minutes_done = std::min(1.0, elapsed_share()) * minutes;
  const char* const ended_by = minutes_done < minutes ? stop.received() : nullptr;
  const std::uint64_t bytes = allocated_with(world, checker, longer.service.nodes, frames);
  const std::uint64_t settled = settled_bytes.value_or(0);
  const bool memory_is_stable = settled == 0 || bytes < settled + settled / 4;
  const Soak::Counts& n = soak.counts();
  fmt::print("{}\nsoak        {:.1f} minutes{}, {} frames, {} contacts; the slowest frame took {:.1f} ms\n",
             longer.title, minutes_done, ended_by ? fmt::format(" of {:.1f}: ended by {}", minutes, ended_by) : "",
             frames, contacts, slowest_ms);
  fmt::print("objects     {} spawned, {} destroyed, {} placed, {} disabled, {} enabled, {} changed; {} at the end\n",
             n.spawned, n.destroyed, n.placed, n.disabled, n.enabled, n.changed, world.report().objects);
  fmt::print("user nodes  {} connected, {} disconnected, {} late, {} inputs; {} shapes registered, {} removed\n",
             n.connected, n.disconnected, n.late, n.inputs, n.shapes, n.shapes_removed);
  fmt::print("CD nodes    {} resizes, {} failures injected, {} nodes lost; {} at the end\n", n.resizes, n.faults,
             n.lost, world.nodes());
  fmt::print("stopped     {} nodes released inside a stage; {} times no thread for a new node\n", n.released,
             n.without_thread);
  fmt::print("refused     {} invalid calls, each counted by its reason\n", n.refused);
  if (longer.output.check) {
    fmt::print("check       {} frames compared with brute force, {} differences\n", checker.frames(),
               checker.differences());
  }
  fmt::print("memory      {:.1f} MiB allocated after a tenth of the time, {:.1f} at the end\n", mebibytes(settled),
             mebibytes(bytes));
  const bool all_passed = n.failures == 0 && checker.passed() && memory_is_stable;
  fmt::print("{}\n", all_passed ? "all checks passed"
                                : fmt::format("FAILED: {} frames or calls failed a check{}", n.failures,
                                              memory_is_stable ? "" : "; memory has grown by more than a quarter"));
  if (!all_passed) return check_failed;
  return ended_by == nullptr ? done : incomplete;
}

}  // namespace ringfence::tools
