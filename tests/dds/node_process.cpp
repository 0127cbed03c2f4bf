// A CD node as a process of its own, with the model that the tests' worlds have. Arguments: domain, name, once or ever.
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>

#include "facade/swarm.hpp"
#include "ringfence/cluster.hpp"

namespace {

ringfence::dds::NodeService* draining_service = nullptr;

void drain(int) { draining_service->drain(); }

}  // namespace

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 4) return 2;
  dds::NodeServiceConfig config;
  config.network.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  config.network.interface = "lo";
  config.name = argv[2];
  config.once = std::string(argv[3]) == "once";
  config.model = [](std::span<const std::byte> setup) {
    double side = 0;
    std::memcpy(&side, setup.data(), sizeof side);
    return std::make_shared<test::Bouncing>(side);
  };
  dds::NodeService service(std::move(config));
  draining_service = &service;
  std::signal(SIGTERM, drain);
  return static_cast<int>(service.run());
}
