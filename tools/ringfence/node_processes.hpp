#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "link_options.hpp"
#include "ringfence/config.hpp"

namespace ringfence::tools {

/// The nodes of a run that are processes: joins the domain, starts them unless others do, and ends them.
///
/// Outlives the World that it is for. In a build without Cyclone DDS everything throws Error, which says what to
/// install.
class NodeProcesses {
 public:
  /// `setup` is what moves the objects; see pack_motion. Throws Error where the domain cannot be joined,
  /// IncompleteError where a process cannot be started.
  NodeProcesses(const LinkOptions& link, std::uint32_t nodes, std::vector<std::byte> setup, LogHook log);
  /// Waits for its processes; those that do not end are killed.
  ~NodeProcesses();
  NodeProcesses(const NodeProcesses&) = delete;
  NodeProcesses& operator=(const NodeProcesses&) = delete;

  std::shared_ptr<RemoteNodes> remote_nodes() const;
  dds::ClusterReport report() const;
  /// One more process, which joins by itself.
  void start_node();

 private:
  std::shared_ptr<dds::Cluster> cluster_;
  dds::NetworkConfig network_;
  std::vector<int> processes_;
};

/// `ringfence node`: serves until it is told to end. Answers the exit code.
int run_node(const NodeOptions& options);

}  // namespace ringfence::tools
