#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace ringfence::tools {

/// The parameters of the cost model of a cluster. One set of values holds for all deployments and node counts.
enum class CostName : std::uint8_t {
  pair_us,          ///< CPU time of the narrow phase of one pair, on a CD node
  move_us,          ///< CPU time to move one object and respond to its contacts, on its host
  object_us,        ///< CPU time of the broad phase per object
  record_us,        ///< CPU time to write or read one record of a message, at each end
  message_us,       ///< CPU time to send or receive one message, at each end
  bandwidth_mbit,   ///< of each machine's link, in each direction
  latency_us,       ///< one way between any two machines
  user_copies,      ///< copies of its states that a user node sends to other user nodes; 0: one to each of them
  shared_user_lan,  ///< 1: all user nodes share one network segment; 0: each has its own link
  overlap,          ///< 1: M3 and the state relay are sent during the narrow phase; 0: after it
  links,            ///< 1: nodes exchange what this release exchanges between processes; 0: all goes to the server
};
inline constexpr std::size_t cost_count = 11;

struct Cost {
  double value = 0;
  std::string source;     ///< origin of the value, for reports
  bool measured = false;  ///< resolve_costs replaces the value by one measured in the current runs
  bool fitted = false;    ///< resolve_costs fits the value to one frame time that the paper states
};

const char* name_of(CostName name);

/// The costs of a cluster in which the server, each CD node and each user node have a machine of their own.
struct ClusterCosts {
  std::string name;   ///< as given to --model
  std::string title;  ///< for tables and plots
  std::array<Cost, cost_count> costs;

  double operator[](CostName cost) const { return costs[static_cast<std::size_t>(cost)].value; }
  Cost& at(CostName cost) { return costs[static_cast<std::size_t>(cost)]; }
  const Cost& at(CostName cost) const { return costs[static_cast<std::size_t>(cost)]; }
};

/// The predefined cluster `2004` or `today`; null for any other name. The result lives until the program ends.
const ClusterCosts* find_cluster(const std::string& name);

/// Error message for an invalid NAME=VALUE of --cost; empty if it is valid.
std::string check_cost(const std::string& text);

/// Replaces costs by the values in `given`, a list of NAME=VALUE. Precondition: check_cost accepts each of them.
void replace_costs(ClusterCosts& cluster, const std::vector<std::string>& given);

}  // namespace ringfence::tools
