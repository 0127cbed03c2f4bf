#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dds/node_model.hpp"
#include "facade/bouncing_world.hpp"
#include "facade/remote_nodes.hpp"
#include "ringfence/cluster.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {

using Clock = std::chrono::steady_clock;

// Under a sanitizer, beside compilers, a live process may be silent for longer than a short lease.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__) || !defined(NDEBUG)
inline constexpr double lease_ms = 1000;
#else
inline constexpr double lease_ms = 100;
#endif

/// Waits until `holds()`, polling every millisecond; returns whether that happened within `seconds`.
template <class Holds>
bool wait_until(Holds holds, double seconds = 20) {
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (!holds()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// A child process; killed with its owner if it has not ended.
class Process {
 public:
  explicit Process(std::vector<std::string> texts) {
    std::vector<char*> arguments;
    for (std::string& text : texts) arguments.push_back(text.data());
    arguments.push_back(nullptr);
    REQUIRE(posix_spawn(&number_, arguments[0], nullptr, nullptr, arguments.data(), environ) == 0);
  }
  ~Process() {
    if (!status_) {
      kill(number_, SIGKILL);
      waitpid(number_, nullptr, 0);
    }
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int which) const { kill(number_, which); }
  bool has_ended() {
    int status = 0;
    if (!status_ && waitpid(number_, &status, WNOHANG) == number_) status_ = status;
    return status_.has_value();
  }
  /// Exit code of a process that has ended by itself; -1 if it was killed.
  int exit_code() const { return status_ && WIFEXITED(*status_) ? WEXITSTATUS(*status_) : -1; }

 private:
  pid_t number_ = 0;
  std::optional<int> status_;
};

/// Where the processes of a world are started, and on which interfaces.
struct ProcessPlacement {
  std::string interface = "lo";
  std::string node_interface = "lo";
  std::function<void()> before_start;  ///< called in the thread that starts the processes
  std::function<void()> after_start;
};

/// A small world with many collisions, whose CD nodes are processes over loopback.
class NodeWorld {
 public:
  static constexpr std::size_t objects = 240;
  static constexpr std::size_t users = 4;
  static constexpr double side = 16;

  using Model = NodeModel::Kind;

  /// `along_x`: number of cells along x as a power of two; 0: default. `saved`: the save from which the world is
  /// restored; empty: it is populated. `deepest_contacts`: as in WorldConfig.
  NodeWorld(Deployment deployment, Placement placement, std::uint32_t nodes, ProcessPlacement place = {},
            std::uint32_t along_x = 0, Model model = Model::bouncing, std::span<const std::byte> saved = {},
            std::uint32_t deepest_contacts = 0)
      : place_(std::move(place)), model_(model), deepest_contacts_(deepest_contacts) {
    const NodeModel setup{side, model};
    dds::ClusterConfig cluster;
    cluster.network.domain = dds::NetworkConfig::any_domain;
    cluster.network.interface = place_.interface;
    cluster.network.lease_ms = lease_ms;
    cluster.setup.resize(sizeof setup);
    std::memcpy(cluster.setup.data(), &setup, sizeof setup);
    cluster.log = [this](LogLevel, std::string_view line) { log_.emplace_back(line); };
    cluster_ = std::make_unique<dds::Cluster>(std::move(cluster));
    for (std::uint32_t node = 0; node < nodes; ++node) start_node();
    WorldConfig config = config_of(deployment, placement, model);
    config.nodes = nodes;
    config.tuning.cells_log2[0] = along_x;
    config.remote_nodes = cluster_->remote_nodes();
    config.deepest_contacts = deepest_contacts;
    if (!saved.empty()) {
      MemorySource source(saved);
      world_ = std::make_unique<World>(std::move(config), source);
      return;
    }
    world_ = std::make_unique<World>(std::move(config));
    populate(*world_, objects, users, side);
  }

  static WorldConfig config_of(Deployment deployment, Placement placement, Model model = Model::bouncing) {
    WorldConfig config;
    config.bounds_max = {side, side, side};
    config.deployment = deployment;
    config.placement = placement;
    config.motion = NodeModel{side, model}.make();
    config.sense = model == Model::sensing ? NodeModel::sense : 0;
    return config;
  }

  /// Digest of the contacts of an undisturbed run in one thread.
  static std::uint64_t expected(std::uint64_t frames, Model model = Model::bouncing,
                                std::uint32_t deepest_contacts = 0) {
    static std::map<std::tuple<Model, std::uint64_t, std::uint32_t>, std::uint64_t> known;
    const std::tuple key(model, frames, deepest_contacts);
    if (const auto found = known.find(key); found != known.end()) return found->second;
    WorldConfig config = config_of(Deployment::user_server, Placement::server, model);
    config.nodes = 0;
    config.deepest_contacts = deepest_contacts;
    World world(std::move(config));
    populate(world, objects, users, side);
    Digest digest;
    for (std::uint64_t frame = 0; frame < frames; ++frame) {
      REQUIRE(world.advance() == Status::ok);
      digest.add_frame(world.contacts());
    }
    return known[key] = digest.value();
  }

  World& world() { return *world_; }
  const dds::Cluster& cluster() const { return *cluster_; }
  /// Number of nodes that are ready and not assigned. Between frames.
  std::size_t waiting() const { return cluster_->remote_nodes()->arrivals().size(); }
  Process& process(std::size_t i) { return *processes_[i]; }
  const std::vector<std::string>& log() const { return log_; }

  /// Starts a node that takes `times` as long as necessary to move an object.
  Process& start_node(int times = 1) {
    const std::string name = "n" + std::to_string(processes_.size());
    if (place_.before_start) place_.before_start();
    processes_.push_back(std::make_unique<Process>(std::vector<std::string>{
        RINGFENCE_NODE, std::to_string(cluster_->domain()), name, place_.node_interface, std::to_string(times)}));
    if (place_.after_start) place_.after_start();
    return *processes_.back();
  }

  void run(std::uint64_t frames, const std::function<void()>& within_first = {}) {
    for (std::uint64_t frame = 0; frame < frames; ++frame) {
      REQUIRE(world_->begin_frame() == Status::ok);
      if (frame == 0 && within_first) within_first();
      REQUIRE(world_->finish_frame() == Status::ok);
      digest_.add_frame(world_->contacts());
      lost_ += world_->report().lost.size();
    }
  }
  /// Runs frames until `holds()`; returns whether it did.
  template <class Holds>
  bool run_until(Holds holds) {
    return wait_until([&] {
      run(1);
      return holds();
    });
  }
  std::uint64_t assigned_nodes() const { return cluster_->report().members.size(); }
  std::uint64_t lost() const { return lost_; }

  /// Whether all frames so far had the contacts of an undisturbed run.
  bool is_right() const { return digest_.value() == expected(world_->frames(), model_, deepest_contacts_); }

 private:
  ProcessPlacement place_;
  Model model_;
  std::uint32_t deepest_contacts_;
  std::vector<std::string> log_;
  std::vector<std::unique_ptr<Process>> processes_;
  std::unique_ptr<dds::Cluster> cluster_;
  std::unique_ptr<World> world_;
  Digest digest_;
  std::uint64_t lost_ = 0;
};

}  // namespace ringfence::test
