#include "link_options.hpp"

#include "option_checks.hpp"

namespace ringfence::tools {
namespace {

void add_network(CLI::App& command, dds::NetworkConfig& network) {
  command.add_option("--interface", network.interface, "name or address of the network interface; lo: this machine")
      ->type_name("NAME");
  command.add_option("--socket-bytes", network.socket_bytes, "what sockets are asked to hold")
      ->check(between(std::size_t{65'536}, std::size_t{1} << 30))
      ->capture_default_str()
      ->type_name("N");
}

}  // namespace

void add_link(CLI::App& command, LinkOptions& link) {
  add_choice(command, "--link", link.kind, {LinkKind::rings, LinkKind::dds},
             "what carries messages between server and CD nodes, dds: to processes");
  command.add_option("--wait-nodes", link.wait_nodes, "with dds: wait for N nodes that are started elsewhere")
      ->check(between(1u, 1024u))
      ->type_name("N");
  command.add_option("--wait-ms", link.wait_ms, "with dds: how long to wait for nodes")
      ->check(between(1.0, 1e9))
      ->capture_default_str()
      ->type_name("MS");
  command.add_option("--lease-ms", link.network.lease_ms, "with dds: who is silent for so long is lost")
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
          "with dds: one world a domain; default 0, or the first free one for nodes of its own")
      ->check(between(0u, 200u))
      ->type_name("N");
  add_network(command, link.network);
}

void add_node(CLI::App& command, NodeOptions& node) {
  command.add_option("--domain", node.network.domain, "the world's")
      ->check(between(0u, 200u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--peers", node.network.peers, "where the world is, as addresses; without: found by multicast")
      ->delimiter(',')
      ->type_name("ADDRESS,...");
  add_network(command, node.network);
  command.add_option("--name", node.name, "for logs and reports; without: host:process")->type_name("NAME");
  command.add_flag("--once", node.once, "end with the first world, instead of waiting for the next");
  command.add_flag("--quiet", node.quiet, "log warnings and errors only");
  command.set_config("--config", "", "options from a file, NAME=VALUE a line")->type_name("FILE");
}

}  // namespace ringfence::tools
