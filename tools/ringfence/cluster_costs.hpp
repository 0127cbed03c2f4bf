#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace ringfence::tools {

/// What a cluster's frame is made of. One set holds for all deployments and all node counts.
enum class CostName : std::uint8_t {
  pair_us,          ///< narrow phase of one pair, on a CD node
  move_us,          ///< moving one object and answering its contacts, on its host
  object_us,        ///< broad phase, each object
  record_us,        ///< writing or reading one record of a message, at each end
  message_us,       ///< sending or receiving one message, at each end
  bandwidth_mbit,   ///< of every machine's link, each way
  latency_us,       ///< one way, between any two machines
  user_copies,      ///< how often a user node sends its states to the other user nodes; 0: once to each of them
  shared_user_lan,  ///< 1: the user nodes share one segment; 0: each has a link of its own
  overlap,          ///< 1: M3 and the state relay travel while nodes still test; 0: after
};
inline constexpr std::size_t cost_count = 10;

struct Cost {
  double value = 0;
  std::string source;     ///< where the value comes from
  bool measured = false;  ///< to be taken from the runs at hand
  bool fitted = false;    ///< to be chosen so that one stated figure of the paper comes out
};

const char* name_of(CostName name);

/// A cluster of machines, one a role: a server, CD nodes, and a machine a user node.
struct ClusterCosts {
  std::string name;   ///< as on the command line
  std::string title;  ///< for tables and plots
  std::array<Cost, cost_count> costs;

  double operator[](CostName cost) const { return costs[static_cast<std::size_t>(cost)].value; }
  Cost& at(CostName cost) { return costs[static_cast<std::size_t>(cost)]; }
  const Cost& at(CostName cost) const { return costs[static_cast<std::size_t>(cost)]; }
};

/// `2004` or `today`; null for any other name.
const ClusterCosts* find_cluster(const std::string& name);

/// What is wrong with NAME=VALUE; empty if nothing is.
std::string check_cost(const std::string& text);

/// Replaces the costs that are given, each checked by check_cost before.
void replace_costs(ClusterCosts& cluster, const std::vector<std::string>& given);

}  // namespace ringfence::tools
