#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "link_options.hpp"
#include "ringfence/config.hpp"

namespace ringfence::tools {

/// The CD nodes of a run that are processes. Joins the DDS domain, starts the processes (unless the user starts them
/// elsewhere) and ends them.
///
/// Must outlive the World that uses it. In a build without Cyclone DDS the constructor throws Error that names the
/// packages to install.
class NodeProcesses {
 public:
  /// `setup` describes the motion model; see pack_motion. Throws Error if the domain cannot be joined, and
  /// IncompleteError if a process cannot be started.
  NodeProcesses(const LinkOptions& link, std::uint32_t nodes, std::vector<std::byte> setup, LogHook log);
  /// Ends the processes that it started. Kills those that do not end within 5 s.
  ~NodeProcesses();
  NodeProcesses(const NodeProcesses&) = delete;
  NodeProcesses& operator=(const NodeProcesses&) = delete;

  std::shared_ptr<RemoteNodes> remote_nodes() const;
  dds::ClusterReport report() const;
  /// Starts one more process, which joins the domain on its own.
  void start_node();

 private:
  std::shared_ptr<dds::Cluster> cluster_;
  dds::NetworkConfig network_;
  std::vector<int> processes_;
};

/// Runs `ringfence node`: serves worlds until the process is signalled or, with --once, the first world ends. Returns
/// the exit code.
int run_node(const NodeOptions& options);

}  // namespace ringfence::tools
