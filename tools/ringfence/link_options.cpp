#include "link_options.hpp"

#include <filesystem>

#include <fmt/format.h>

#include "option_checks.hpp"
#include "option_groups.hpp"

namespace ringfence::tools {
namespace {

void add_network(CLI::App& command, dds::NetworkConfig& network) {
  command.add_option("--world", network.world, "name of the world; worlds with different names can share a DDS domain")
      ->type_name("NAME");
  command
      .add_option("--interface", network.interface, "name or address of the network interface; lo: this machine only")
      ->type_name("NAME");
  command.add_option("--socket-bytes", network.socket_bytes, "requested size of socket buffers")
      ->check(between(std::size_t{65'536}, std::size_t{1} << 30))
      ->capture_default_str()
      ->type_name("N");
}

}  // namespace

void add_link(CLI::App& command, LinkOptions& link) {
  command.option_defaults()->group(option_groups::processes);
  add_choice(command, "--link", link.kind, {LinkKind::rings, LinkKind::dds},
             "transport between server and CD nodes, which are processes with dds");
  command
      .add_option("--wait-nodes", link.wait_nodes,
                  "with dds: wait for N nodes that are started elsewhere, instead of starting them")
      ->check(between(1u, 1024u))
      ->type_name("N");
  command.add_option("--wait-ms", link.wait_ms, "with dds: maximum time to wait for nodes")
      ->check(between(1.0, 1e9))
      ->capture_default_str()
      ->type_name("MS");
  command.add_option("--lease-ms", link.network.lease_ms, "with dds: a process that is silent for this long is lost")
      ->check(between(10.0, 60'000.0))
      ->capture_default_str()
      ->type_name("MS");
  command
      .add_option_function<std::uint32_t>(
          "--domain",
          [&link](const std::uint32_t& domain) {
            link.network.domain = domain;
            link.domain_given = true;
          },
          "with dds: DDS domain, one per world name; default: the first free one, or 0 with --wait-nodes")
      ->check(between(0u, 200u))
      ->type_name("N");
  add_network(command, link.network);
}

void add_node(CLI::App& command, NodeOptions& node) {
  command.option_defaults()->group(option_groups::service);
  command.add_option("--domain", node.network.domain, "DDS domain of the world")
      ->check(between(0u, 200u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--peers", node.network.peers, "addresses of the world's machine; default: find it by multicast")
      ->delimiter(',')
      ->type_name("ADDRESS,...");
  add_network(command, node.network);
  command.add_option("--name", node.name, "name in logs and reports; default: host:process")->type_name("NAME");
  command.add_flag("--once", node.once, "exit after the first world instead of waiting for the next");
  // Without this check the parser ignores a file that does not exist.
  const auto check_file = [](const std::string& file) {
    return std::filesystem::exists(file) ? std::string() : fmt::format("found {}; expected a file that exists", file);
  };
  command.set_config("--config", "", "read options from a file of NAME=VALUE lines")
      ->check(CLI::Validator(check_file, ""))
      ->type_name("FILE");
  command.option_defaults()->group(option_groups::output);
  command.add_option("--metrics", node.metrics, "serve metrics for Prometheus at /metrics of this loopback address")
      ->type_name("HOST:PORT");
  command.add_flag("--quiet", node.quiet, "log warnings and errors only");
}

}  // namespace ringfence::tools
