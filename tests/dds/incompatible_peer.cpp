// An incompatible node process, or one that refuses the World: announces itself until it is killed. Arguments: domain,
// Difference, NodeState, reason.
#include "dds/incompatible_peer.hpp"

#include <cstdlib>

#include <unistd.h>

#include "dds/domain.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 5) return 2;
  dds::NetworkConfig network;
  network.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  network.interface = "lo";
  dds::Domain domain(network, dds::Side::node);
  domain.start_heartbeat(network.lease_ms);
  const dds::Entity writer = domain.writer(dds::Topic::presence, dds::liveliness_qos(network.lease_ms), {});
  char name[] = "peer";
  dds::PresenceSample sample{};
  sample.incarnation = 5;
  sample.version = dds::wire_version;
  dds::write_byte_order(sample.order);
  sample.layout = dds::record_layout_hash();
  sample.state = static_cast<std::uint32_t>(std::atoi(argv[3]));
  sample.name = name;
  sample.reason = argv[4];
  test::make_incompatible(sample, static_cast<test::Difference>(std::atoi(argv[2])));
  if (dds_write(writer.get(), &sample) != DDS_RETCODE_OK) return 3;
  for (;;) pause();
}
