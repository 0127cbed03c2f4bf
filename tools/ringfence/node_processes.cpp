#include "node_processes.hpp"

#include <csignal>
#include <cstring>
#include <string>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "exit_code.hpp"
#include "motion_setup.hpp"
#include "node_metrics.hpp"

namespace ringfence::tools {
namespace {

dds::NodeService* draining_service = nullptr;

void drain(int) { draining_service->drain(); }

}  // namespace

NodeProcesses::NodeProcesses(const LinkOptions& link, std::uint32_t nodes, std::vector<std::byte> setup, LogHook log)
    : network_(link.network) {
  const bool own = link.wait_nodes == 0;
  if (own && network_.interface.empty()) network_.interface = "lo";
  if (own && !link.domain_given) network_.domain = dds::NetworkConfig::any_domain;
  dds::ClusterConfig config;
  config.network = network_;
  config.wait_ms = link.wait_ms;
  config.setup = std::move(setup);
  config.log = std::move(log);
  cluster_ = std::make_shared<dds::Cluster>(std::move(config));
  network_.domain = cluster_->domain();
  for (std::uint32_t node = 0; own && node < nodes; ++node) start_node();
}

NodeProcesses::~NodeProcesses() {
  constexpr auto step = std::chrono::milliseconds(2);
  constexpr int max_steps = 2500;
  cluster_.reset();
  // A process whose World has ended ends too; one that never had a World would wait for it.
  for (const int process : processes_) kill(process, SIGTERM);
  int steps = 0;
  for (const int process : processes_) {
    int status = 0;
    while (waitpid(process, &status, WNOHANG) == 0) {
      if (++steps >= max_steps) kill(process, SIGKILL);
      std::this_thread::sleep_for(step);
    }
  }
}

std::shared_ptr<RemoteNodes> NodeProcesses::remote_nodes() const { return cluster_->remote_nodes(); }

dds::ClusterReport NodeProcesses::report() const { return cluster_->report(); }

void NodeProcesses::start_node() {
  std::vector<std::string> words = {"ringfence",      "node",
                                    "--once",         "--quiet",
                                    "--domain",       std::to_string(network_.domain),
                                    "--interface",    network_.interface,
                                    "--socket-bytes", std::to_string(network_.socket_bytes)};
  if (!network_.world.empty()) words.insert(words.end(), {"--world", network_.world});
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  // A process group of its own: Ctrl-C on the terminal ends the run, and the run ends its nodes.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t process = 0;
  const int error = posix_spawn(&process, "/proc/self/exe", nullptr, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) throw IncompleteError(fmt::format("cannot start a node process: {}", std::strerror(error)));
  processes_.push_back(process);
}

int run_node(const NodeOptions& options) {
  dds::NodeServiceConfig config;
  config.network = options.network;
  config.name = options.name;
  config.once = options.once;
  config.model = unpack_motion;
  const LogLevel least = options.quiet ? LogLevel::warning : LogLevel::info;
  config.log = [least](LogLevel level, std::string_view line) {
    if (level >= least) fmt::print(stderr, "ringfence node {}: {}\n", getpid(), line);
  };
  dds::NodeService service(std::move(config));
  const NodeMetrics metrics(options.metrics, service);
  draining_service = &service;
  struct sigaction action {};
  action.sa_handler = drain;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  const dds::ExitReason reason = service.run();
  if (!options.quiet) fmt::print(stderr, "ringfence node {}: ended: {}\n", getpid(), name_of(reason));
  // If the network interface is gone, the threads of Cyclone DDS do not end. A second signal then ends the process.
  std::signal(SIGTERM, SIG_DFL);
  std::signal(SIGINT, SIG_DFL);
  switch (reason) {
    case dds::ExitReason::drained:
    case dds::ExitReason::dismissed:
      return done;
    case dds::ExitReason::refused:
      return usage_error;
    case dds::ExitReason::abandoned:
      break;
  }
  return incomplete;
}

}  // namespace ringfence::tools
