#pragma once

#include "cluster_costs.hpp"
#include "scale_run.hpp"

namespace ringfence::tools {

/// What crosses the boundaries of machines in a frame of a cluster in which the server, each CD node and each user node
/// have a machine of their own.
struct ClusterTraffic {
  // Through the server, in the order of the frame.
  MeanTraffic frame;     ///< messages that begin and end it
  MeanTraffic states;    ///< states to the server that the frame needs: M1, and those of CD nodes
  MeanTraffic replicas;  ///< states to the server that no step of the frame waits for
  MeanTraffic m2;
  MeanTraffic m3;
  MeanTraffic relay;  ///< states of what users do not host, to the users: once for all
  MeanTraffic m4;
  double user_bytes = 0;  ///< states that user nodes send to each other: each once
  // At the ends of one CD node.
  MeanTraffic node_m2;   ///< what it sends and receives until it tests
  MeanTraffic node_end;  ///< what it sends and receives afterwards
};

/// Derives the traffic from the counts of a run in one process. With CostName::links 0, all goes to the server, as the
/// paper describes it. With 1 it is what processes of this release exchange (docs/protocol.md): between the server and
/// a node one parcel in each direction in each of three steps of the frame; with the broad phase in the regions,
/// states of what nodes host only as replicas; and ghosts, contacts for hosts and hand-overs from node to node, with up
/// to 26 neighbours.
ClusterTraffic traffic_of(const FrameCounts& counts, const ClusterCosts& costs);

/// Number of position records in M2, which also has pairs if the server does the broad phase.
double positions(const FrameCounts& counts);

/// Mean number of regions that a moved object overlaps. In user/collision deployment its host needs no position record.
double regions_per_object(const FrameCounts& counts);

}  // namespace ringfence::tools
