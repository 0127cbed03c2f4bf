// The costs of the predefined clusters and the source of each value.
#include "cluster_costs.hpp"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr const char* cost_names[] = {"pair_us",         "move_us",        "object_us",  "record_us",
                                      "message_us",      "bandwidth_mbit", "latency_us", "user_copies",
                                      "shared_user_lan", "overlap",        "links"};

Cost stated(double value, const char* source) { return {value, source, false, false}; }
Cost measured(double fallback) { return {fallback, "measured in these runs", true, false}; }

/// The cluster of section 4 of the paper: Pentium III 700 MHz, Java, 100 Mbit/s Ethernet, less than 1 ms from user
/// nodes to the server. Only pair_us is fitted, to one frame time. The other values were chosen before the first run of
/// the model.
ClusterCosts cluster_2004() {
  ClusterCosts cluster;
  cluster.name = "2004";
  cluster.title = "the paper's cluster: Pentium III 700 MHz, Java, 100 Mbit/s";
  cluster.at(CostName::pair_us) = {700, "fitted to the paper's 4100 ms: user-collision, 1 node, 4000 objects", false,
                                   true};
  cluster.at(CostName::move_us) = stated(5, "assumed: 3500 cycles");
  cluster.at(CostName::object_us) = stated(2, "assumed: 1400 cycles, sweep and prune with coherence [5]");
  cluster.at(CostName::record_us) = stated(1, "assumed: 700 cycles for about 100 bytes in Java");
  cluster.at(CostName::message_us) =
      stated(50, "assumed: a socket call from Java; by RMI 375 (1.5 ms per round trip, Philippsen et al. 2000)");
  cluster.at(CostName::bandwidth_mbit) = stated(100, "the paper, section 4");
  cluster.at(CostName::latency_us) = stated(500, "half of the paper's \"less than 1 ms\"");
  cluster.at(CostName::user_copies) =
      stated(0, "the paper, 3.2: user nodes inform other user nodes; no multicast is named");
  cluster.at(CostName::shared_user_lan) = stated(1, "assumed: \"fast Ethernet\", one segment for the user LAN");
  cluster.at(CostName::overlap) = stated(1, "assumed: nodes send contacts while they test");
  cluster.at(CostName::links) = stated(0, "the paper: nodes report to the server");
  return cluster;
}

/// The same roles on current hardware: CPU costs measured on this machine, and assumptions for a 25 Gbit/s network.
ClusterCosts cluster_today() {
  ClusterCosts cluster;
  cluster.name = "today";
  cluster.title = "a cluster of this machine's cores, 25 Gbit/s";
  cluster.at(CostName::pair_us) = measured(0.2);
  cluster.at(CostName::move_us) = measured(0.2);
  cluster.at(CostName::object_us) = measured(0.06);
  cluster.at(CostName::record_us) =
      stated(0.045, "the server's thread with 4 node processes and 64,000 objects: 6.2 ms for 144,000 records");
  cluster.at(CostName::message_us) =
      stated(3.5, "the server's thread with 64 node processes and one object: 1.36 ms for 6 x 64 messages");
  cluster.at(CostName::bandwidth_mbit) = stated(25'000, "assumed: 25 Gbit/s Ethernet");
  cluster.at(CostName::latency_us) = stated(10, "assumed: kernel to kernel within a rack");
  cluster.at(CostName::user_copies) = stated(1, "the publication: written once, read by many (multicast)");
  cluster.at(CostName::shared_user_lan) = stated(0, "switched");
  cluster.at(CostName::overlap) = stated(0, "this engine: M3 after a node's last pair, the relay after the contacts");
  cluster.at(CostName::links) = stated(1, "this engine: hosts keep states, nodes send neighbours what is at borders");
  return cluster;
}

bool split(const std::string& text, std::size_t& index, double& value) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return false;
  for (index = 0; index < cost_count && text.substr(0, equals) != cost_names[index];) ++index;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + equals + 1, end, value);
  return index < cost_count && error == std::errc() && stop == end && std::isfinite(value) && value >= 0;
}

}  // namespace

const char* name_of(CostName name) { return cost_names[static_cast<std::size_t>(name)]; }

const ClusterCosts* find_cluster(const std::string& name) {
  static const ClusterCosts clusters[] = {cluster_2004(), cluster_today()};
  for (const ClusterCosts& cluster : clusters) {
    if (cluster.name == name) return &cluster;
  }
  return nullptr;
}

std::string check_cost(const std::string& text) {
  std::size_t index = 0;
  double value = 0;
  if (split(text, index, value) && !(value == 0 && index == static_cast<std::size_t>(CostName::bandwidth_mbit))) {
    return {};
  }
  std::string names;
  for (const char* name : cost_names) names += fmt::format("{}{}", names.empty() ? "" : ", ", name);
  return fmt::format("found {}; expected NAME=VALUE with a value of 0 or more (bandwidth: more than 0) and one of {}",
                     text, names);
}

void replace_costs(ClusterCosts& cluster, const std::vector<std::string>& given) {
  for (const std::string& text : given) {
    std::size_t index = 0;
    double value = 0;
    if (split(text, index, value)) cluster.costs[index] = {value, "given by --cost", false, false};
  }
}

}  // namespace ringfence::tools
