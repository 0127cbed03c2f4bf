#pragma once

#include <cstdint>
#include <string>

#include <CLI/CLI.hpp>

#include "ringfence/cluster.hpp"

namespace ringfence::tools {

/// What carries messages between the server and the CD nodes.
enum class LinkKind : std::uint8_t { rings, dds };
constexpr const char* name_of(LinkKind kind) noexcept {
  constexpr const char* names[] = {"rings", "dds"};
  return names[static_cast<std::size_t>(kind)];
}

/// How a run reaches nodes in other processes.
struct LinkOptions {
  LinkKind kind = LinkKind::rings;
  std::uint32_t wait_nodes = 0;  ///< nodes that others start; 0: the program starts them itself
  double wait_ms = 10'000;
  bool domain_given = false;
  dds::NetworkConfig network;
};

/// `ringfence node`.
struct NodeOptions {
  dds::NetworkConfig network;
  std::string name;
  bool once = false;
  bool quiet = false;
};

void add_link(CLI::App& command, LinkOptions& link);
void add_node(CLI::App& command, NodeOptions& node);

}  // namespace ringfence::tools
