// An incompatible node process, or one that refuses the World: reads the World's terms and announces itself until it is
// killed. With Difference::world it announces itself twice, for another World and for this one. Arguments: domain,
// Difference, NodeState, reason.
#include "dds/incompatible_peer.hpp"

#include <cstdlib>

#include <unistd.h>

#include "dds/domain.hpp"
#include "dds/link_socket.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 5) return 2;
  dds::NetworkConfig network;
  network.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  network.interface = "lo";
  dds::Domain domain(network, dds::Side::node);
  domain.start_heartbeat(network.lease_ms);
  const dds::Entity writer = domain.writer(dds::Topic::presence, dds::liveliness_qos(network.lease_ms), {});
  const dds::Entity terms = domain.reader(dds::Topic::terms, dds::liveliness_qos(network.lease_ms), {});
  std::uint64_t world = 0;
  while (world == 0) {
    dds::take_all<dds::TermsSample>(
        terms, [&](const dds::TermsSample& sample, const dds_sample_info_t&) { world = sample.world; });
    usleep(1000);
  }
  char name[] = "peer";
  dds::PresenceSample sample{};
  sample.version = dds::wire_version;
  dds::write_byte_order(sample.order);
  sample.layout = dds::fingerprint();
  sample.world = world;
  sample.state = static_cast<std::uint32_t>(std::atoi(argv[3]));
  sample.name = name;
  sample.reason = argv[4];
  const auto difference = static_cast<test::Difference>(std::atoi(argv[2]));
  const auto compatible = sample;
  test::make_incompatible(sample, difference);
  // A World assigns a node only if it has a link to it.
  const dds::LinkSocket listening_socket = dds::LinkSocket::listen(1, 0);
  sample.incarnation = 4;
  if (dds_write(writer.get(), &sample) != DDS_RETCODE_OK) return 3;
  if (difference == test::Difference::world) {
    sample = compatible;
    sample.incarnation = 6;
    if (dds_write(writer.get(), &sample) != DDS_RETCODE_OK) return 3;
  }
  const dds::Entity listener = domain.writer(dds::Topic::listener, dds::piece_qos, dds::partition_of_world(world));
  for (const std::uint64_t incarnation : {4u, 6u}) {
    const dds::ListenerSample listening{incarnation, listening_socket.port()};
    if (dds_write(listener.get(), &listening) != DDS_RETCODE_OK) return 3;
  }
  for (;;) pause();
}
