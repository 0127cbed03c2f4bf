// Replaces node_processes.cpp in a build without Cyclone DDS.
#include "node_processes.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

[[noreturn]] void refuse() {
  throw Error(
      "this build has no Cyclone DDS: install cyclonedds-dev and cyclonedds-tools, then configure and build again");
}

}  // namespace

NodeProcesses::NodeProcesses(const LinkOptions&, std::uint32_t, std::vector<std::byte>, LogHook) { refuse(); }
NodeProcesses::~NodeProcesses() = default;
std::shared_ptr<RemoteNodes> NodeProcesses::remote_nodes() const { refuse(); }
dds::ClusterReport NodeProcesses::report() const { refuse(); }
void NodeProcesses::start_node() { refuse(); }
int run_node(const NodeOptions&) { refuse(); }

}  // namespace ringfence::tools
