#include "cluster_traffic.hpp"

#include <algorithm>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::tools {
namespace {

/// The parts of the counted traffic that both protocols have.
struct Counted {
  double nodes, users;
  double relayed;           ///< states of what users do not host
  double user_states;       ///< records of M1 that the server receives
  double user_state_bytes;  ///< of these
  double node_states;       ///< states that changed on CD nodes
  double node_state_bytes;
};

/// A run counts publications to users once under M1 or states. The remainder is what hosts send to the server.
Counted counted_in(const FrameCounts& counts) {
  const MeanTraffic &m1 = counts[Traffic::m1], &state = counts[Traffic::state];
  Counted out{};
  out.nodes = std::max(1.0, counts.nodes);
  out.users = std::max(1.0, counts.users);
  out.relayed = counts.server_hosted + counts.node_hosted;
  out.user_states = std::max(0.0, m1.records - counts.user_hosted);
  out.user_state_bytes = std::max(0.0, m1.bytes - counts.user_hosted * sizeof(SeenState));
  out.node_states = std::max(0.0, state.records - out.relayed);
  out.node_state_bytes = std::max(0.0, state.bytes - out.relayed * sizeof(SeenState));
  return out;
}

/// As the paper describes it.
void through_server(const FrameCounts& counts, const Counted& counted, ClusterTraffic& out) {
  const MeanTraffic &m2 = counts[Traffic::m2], &m5 = counts[Traffic::m5], &control = counts[Traffic::control];
  // Between machines the states themselves are messages, so the notices of readable shared memory are not needed.
  const double notices = counts.publication_notices;
  out.frame = {std::max(0.0, control.messages - notices), 0,
               std::max(0.0, control.bytes - notices * sizeof(messages::Header))};
  out.states = {counts[Traffic::m1].messages + std::max(0.0, counts[Traffic::state].messages - 1),
                counted.user_states + counted.node_states, counted.user_state_bytes + counted.node_state_bytes};
  out.m2 = m2;
  out.m3 = {counts[Traffic::m3].messages, counts.contacts, counts[Traffic::m3].bytes};
  out.m4 = counts[Traffic::m4];
  out.node_m2 = {m2.messages / counted.nodes, m2.records / counted.nodes, 0};
  out.node_end = {2 * m5.messages / counted.nodes, 2 * m5.records / counted.nodes, m5.bytes / counted.nodes};
}

/// As the processes of this release do.
void over_links(const FrameCounts& counts, const Counted& counted, ClusterTraffic& out) {
  constexpr double most_neighbours = 26, header = sizeof(messages::Header);
  const double n = counted.nodes, users = counted.users;
  const bool in_regions = counts.placement != Placement::server;
  out.frame = {2 * (n + users), 0, 2 * (n + users) * header};
  out.states = {users + n, counted.user_states, counted.user_state_bytes};
  (in_regions ? out.replicas : out.states).records += counted.node_states;
  (in_regions ? out.replicas : out.states).bytes += counted.node_state_bytes;
  if (in_regions) {
    out.replicas.bytes -= counted.node_states * (sizeof(messages::NodeStateRecord) - sizeof(messages::ReplicaRecord));
  }

  // The server sends what no node hosts, and without a sweep in the regions everything.
  const double all = positions(counts);
  const double ghosts = in_regions ? std::max(0.0, all - counted.user_states * regions_per_object(counts)) : 0;
  const double pairs = in_regions ? 0 : counts.tested;
  const double neighbours = std::min(most_neighbours, n - 1);
  out.m2 = {n, all - ghosts + pairs,
            (all - ghosts) * sizeof(messages::PositionRecord) + pairs * sizeof(messages::PairRecord)};
  const double ghost_messages = ghosts > 0 ? 2 * neighbours : 0;
  out.node_m2 = {3 + ghost_messages, (out.m2.records + 2 * ghosts) / n, ghosts * sizeof(messages::PositionRecord) / n};

  out.m3 = {n, counts.contacts, counts.contacts * sizeof(messages::CollisionRecord)};
  const MeanTraffic &m4 = counts[Traffic::m4], &m5 = counts[Traffic::m5];
  const double notices = std::min(counts.node_notices, m4.records), notice_bytes = notices * sizeof(Contact);
  out.m4 = {users + n, m4.records - notices, std::max(0.0, m4.bytes - notice_bytes)};
  const double notice_messages = notices > 0 ? 2 * neighbours : 0;
  out.node_end = {3 + notice_messages + 2 * m5.messages / n, 2 * (notices + m5.records) / n,
                  (notice_bytes + m5.bytes) / n};
}

}  // namespace

ClusterTraffic traffic_of(const FrameCounts& counts, const ClusterCosts& costs) {
  const Counted counted = counted_in(counts);
  ClusterTraffic out;
  if (counted.relayed > 0) out.relay = {1, counted.relayed, counted.relayed * sizeof(SeenState)};
  out.user_bytes = counts.user_hosted * sizeof(SeenState);
  if (costs[CostName::links] > 0) {
    over_links(counts, counted, out);
  } else {
    through_server(counts, counted, out);
  }
  return out;
}

double positions(const FrameCounts& counts) {
  return std::max(0.0, counts[Traffic::m2].records - (counts.placement == Placement::server ? counts.tested : 0));
}

double regions_per_object(const FrameCounts& counts) {
  if (counts.moved <= 0 || counts.nodes <= 1) return 1;
  const double without_record = counts.node_hosted > 0 ? counts.moved * counts.node_hosted / counts.objects : 0;
  return std::max(1.0, (positions(counts) + without_record) / counts.moved);
}

}  // namespace ringfence::tools
