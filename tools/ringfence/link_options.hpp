#pragma once

#include <cstdint>
#include <string>

#include <CLI/CLI.hpp>

#include "ringfence/cluster.hpp"

namespace ringfence::tools {

/// The transport between the server and the CD nodes: rings to threads, or DDS to processes.
enum class LinkKind : std::uint8_t { rings, dds };
constexpr const char* name_of(LinkKind kind) noexcept {
  constexpr const char* names[] = {"rings", "dds"};
  return names[static_cast<std::size_t>(kind)];
}

/// Options of run, replay and record for CD nodes in other processes.
struct LinkOptions {
  LinkKind kind = LinkKind::rings;
  std::uint32_t wait_nodes = 0;  ///< number of nodes that are started elsewhere; 0: the program starts its own
  double wait_ms = 10'000;
  bool domain_given = false;
  dds::NetworkConfig network;
};

/// Options of `ringfence node`.
struct NodeOptions {
  dds::NetworkConfig network;
  std::string name;
  std::string metrics;  ///< HOST:PORT
  bool once = false;
  bool quiet = false;
};

void add_link(CLI::App& command, LinkOptions& link);
void add_node(CLI::App& command, NodeOptions& node);

}  // namespace ringfence::tools
