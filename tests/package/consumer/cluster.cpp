// Checks that a program can link the library for CD nodes in other processes: the World's side joins a DDS domain of
// this machine.

#include <cstdio>

#include <ringfence/cluster.hpp>
#include <ringfence/world.hpp>

int main() {
  const ringfence::dds::Cluster cluster(
      {.network = {.domain = ringfence::dds::NetworkConfig::any_domain, .interface = "lo"}});
  std::printf("domain %u\n", cluster.domain());
  return cluster.report().members.empty() ? 0 : 1;
}
