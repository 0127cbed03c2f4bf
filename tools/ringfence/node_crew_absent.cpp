// In place of node_crew.cpp where Cyclone DDS is not there.
#include "node_crew.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

[[noreturn]] void refuse() {
  throw Error(
      "this build is without Cyclone DDS: install cyclonedds-dev and cyclonedds-tools, then configure and build anew");
}

}  // namespace

NodeCrew::NodeCrew(const LinkOptions&, std::uint32_t, std::vector<std::byte>, LogHook) { refuse(); }
NodeCrew::~NodeCrew() = default;
std::shared_ptr<Fleet> NodeCrew::fleet() const { refuse(); }
dds::ClusterReport NodeCrew::report() const { refuse(); }
void NodeCrew::start_node() { refuse(); }
int run_node(const NodeOptions&) { refuse(); }

}  // namespace ringfence::tools
