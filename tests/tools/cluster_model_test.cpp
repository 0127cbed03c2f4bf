#include "cluster_model.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "cluster_traffic.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::tools {
namespace {

ClusterCosts free_cluster() {
  ClusterCosts costs;
  costs.name = "test";
  costs.at(CostName::bandwidth_mbit).value = 1e12;
  costs.at(CostName::user_copies).value = 1;
  return costs;
}

FrameCounts counts_of(double nodes) {
  FrameCounts counts;
  counts.objects = 1000;
  counts.users = 10;
  counts.nodes = nodes;
  counts.user_hosted = 100;
  counts.node_hosted = 900;
  counts.moved = 1000;
  counts.tested = 1600;
  counts.busiest_tested = 1600 / nodes;
  counts.contacts = 700;
  counts[Traffic::m1] = {10, 200, 100 * 56 + 100.0 * sizeof(SeenState)};
  counts[Traffic::m2] = {nodes, 1700, 20000};
  counts[Traffic::m3] = {nodes, 700, 100000};
  counts[Traffic::m4] = {10 + nodes, 1300, 180000};
  counts[Traffic::state] = {nodes + 1, 1800, 900 * 80 + 900.0 * sizeof(SeenState)};
  counts[Traffic::control] = {20 + 6 * nodes, 0, 2000};
  return counts;
}

ScaleRow row_of(Deployment deployment, std::uint32_t nodes, std::uint32_t objects, const FrameCounts& counts) {
  ScaleRow row;
  row.deployment = deployment;
  row.nodes = nodes;
  row.objects = objects;
  row.samples.emplace_back().counts = counts;
  return row;
}

}  // namespace

TEST_CASE("if only pairs cost time, the predicted frame time is inversely proportional to the number of nodes") {
  ClusterCosts costs = free_cluster();
  costs.at(CostName::pair_us).value = 700;
  const double one = compute_cluster_frame(counts_of(1), costs).total();
  CHECK(one == doctest::Approx(1120));
  for (const double nodes : {2.0, 4.0, 16.0}) {
    CHECK(one / compute_cluster_frame(counts_of(nodes), costs).total() == doctest::Approx(nodes));
  }
}

TEST_CASE("each part of a predicted frame is its counts times its costs") {
  ClusterCosts costs = free_cluster();
  const FrameCounts counts = counts_of(2);
  const auto with = [&](CostName name, double value) {
    ClusterCosts changed = costs;
    changed.at(name).value = value;
    return compute_cluster_frame(counts, changed);
  };
  CHECK(with(CostName::latency_us, 500).total() == doctest::Approx(3));
  CHECK(with(CostName::object_us, 2).sweep == doctest::Approx(2));
  CHECK(with(CostName::move_us, 10).move == doctest::Approx(4.5));  // 450 on each node, 10 on each user node
  // 100 Mbit/s is 12,500 bytes per millisecond. The server receives M1 and node states, and sends M2, M4 and the relay.
  const ClusterFrame wire = with(CostName::bandwidth_mbit, 100);
  CHECK(wire.states == doctest::Approx((100 * 56 + 900 * 80) / 12500.0));
  CHECK(wire.m2 == doctest::Approx(1.6));
  CHECK(wire.m3 == doctest::Approx(8.0));  // M3 is received while the relay is sent
  CHECK(wire.m4 == doctest::Approx(14.4));
  CHECK(wire.hops == doctest::Approx(0.16));
  const ClusterFrame messages = with(CostName::message_us, 1000);
  CHECK(messages.states == doctest::Approx(12));
  CHECK(messages.m2 == doctest::Approx(2));
  CHECK(messages.narrow == doctest::Approx(1));
  CHECK(messages.m3 == doctest::Approx(3));
  CHECK(messages.m4 == doctest::Approx(12));
  CHECK(messages.hops == doctest::Approx(32));
}

TEST_CASE("on a shared segment the copies that user nodes send to each other share the bandwidth") {
  ClusterCosts costs = free_cluster();
  costs.at(CostName::bandwidth_mbit).value = 100;
  costs.at(CostName::shared_user_lan).value = 1;
  costs.at(CostName::user_copies).value = 0;
  const double bytes = 100 * 56 + 9 * 100.0 * sizeof(SeenState);
  CHECK(compute_cluster_frame(counts_of(1), costs).states ==
        doctest::Approx(std::max(bytes, 100.0 * 56 + 900 * 80) / 12500));
  FrameCounts many = counts_of(1);
  many.users = 100;
  CHECK(compute_cluster_frame(many, costs).states ==
        doctest::Approx((100 * 56 + 99 * 100.0 * sizeof(SeenState)) / 12500));
}

TEST_CASE("with overlap only the part of M3 that exceeds the narrow phase takes time") {
  ClusterCosts costs = free_cluster();
  costs.at(CostName::bandwidth_mbit).value = 100;
  costs.at(CostName::overlap).value = 1;
  costs.at(CostName::pair_us).value = 3;  // 4.8 ms of 8 ms
  CHECK(compute_cluster_frame(counts_of(1), costs).m3 == doctest::Approx(8 - 4.8));
  costs.at(CostName::pair_us).value = 30;
  CHECK(compute_cluster_frame(counts_of(1), costs).m3 == 0);
}

TEST_CASE("over links, the server exchanges one message in each direction with each node in each of three steps") {
  ClusterCosts costs = free_cluster();
  costs.at(CostName::links).value = 1;
  costs.at(CostName::message_us).value = 1000;
  // 10 users have five messages: begin, states, M4 and done, and the relay, which is one for all.
  for (const double nodes : {1.0, 2.0, 16.0, 1024.0}) {
    FrameCounts counts = counts_of(nodes);
    counts.placement = Placement::region;
    CHECK(compute_cluster_load(counts, costs).server_cpu == doctest::Approx(6 * nodes + 4 * 10 + 1));
  }
}

TEST_CASE(
    "over links, states of what nodes host are replicas for which no step waits, and neighbours send each other "
    "ghosts") {
  ClusterCosts costs = free_cluster();
  costs.at(CostName::links).value = 1;
  costs.at(CostName::bandwidth_mbit).value = 8;  // 1000 bytes are 1 ms
  FrameCounts counts = counts_of(2);
  const auto by_server = traffic_of(counts, costs);
  CHECK(by_server.states.records == 1000);  // 100 of users, 900 of nodes
  CHECK(by_server.replicas.records == 0);
  CHECK(by_server.m2.records == 1700);  // 100 positions and 1600 pairs
  CHECK(by_server.node_m2.bytes == 0);

  counts.placement = Placement::region;
  counts[Traffic::m2].records = 1300;  // of 1000 moved objects, of which 100 are those of users
  counts.node_notices = 300;
  const ClusterTraffic traffic = traffic_of(counts, costs);
  CHECK(traffic.states.records == 100);
  CHECK(traffic.replicas.records == 900);
  CHECK(traffic.replicas.bytes == 900 * 48);  // 80 bytes of a state counted in one process, of which a replica needs 48
  const double regions = regions_per_object(counts);
  CHECK(regions == doctest::Approx((1300 + 900) / 1000.0));
  CHECK(traffic.m2.records == doctest::Approx(100 * regions));
  CHECK(traffic.m2.records + traffic.node_m2.bytes * 2 / 104 == doctest::Approx(1300));
  CHECK(traffic.node_m2.records == doctest::Approx((100 * regions + 2 * (1300 - 100 * regions)) / 2));
  CHECK(traffic.m3.bytes == 700 * 40);
  CHECK(traffic.m4.records == 1000);
  CHECK(traffic.node_end.records == doctest::Approx(300));
  CHECK(traffic.node_end.bytes == doctest::Approx(150 * 120));

  // The server's link receives replicas while the nodes go on; what is left when the frame is complete delays the next.
  const ClusterFrame frame = compute_cluster_frame(counts, costs);
  const ClusterLoad load = compute_cluster_load(counts, costs);
  CHECK(load.server_link >= (traffic.replicas.bytes + traffic.m3.bytes) / 1000);
  CHECK(frame.total() >= std::max(load.server_cpu, load.server_link));
  counts[Traffic::state].bytes += 1e6;  // of nodes
  CHECK(compute_cluster_frame(counts, costs).total() ==
        doctest::Approx(compute_cluster_load(counts, costs).server_link));
}

TEST_CASE("with the paper's protocol the server has no work left when a frame is complete") {
  for (const double nodes : {1.0, 16.0}) {
    for (const char* name : {"2004", "today"}) {
      ClusterCosts costs = *find_cluster(name);
      costs.at(CostName::links).value = 0;
      CHECK(compute_cluster_frame(counts_of(nodes), costs).wait == 0);
    }
  }
}

TEST_CASE("the fitted cost reproduces the frame time it is fitted to; without that row it has its default value") {
  const std::vector<ScaleRow> rows{row_of(Deployment::user_collision, 1, 4000, counts_of(1)),
                                   row_of(Deployment::user_collision, 16, 4000, counts_of(16))};
  const ClusterCosts costs = resolve_costs(*find_cluster("2004"), rows);
  CHECK(compute_cluster_frame(rows[0].counts(), costs).total() == doctest::Approx(4100));
  const std::vector<ClusterPrediction> predictions = predict(rows, costs, {});
  REQUIRE(predictions.size() == 2);
  CHECK(predictions[1].paper->ms == 300);
  CHECK(predictions[1].scaling.speedup == doctest::Approx(4100 / predictions[1].frame.total()));

  const ClusterCosts unfitted = resolve_costs(*find_cluster("2004"), {rows[1]});
  CHECK(unfitted[CostName::pair_us] == 700);
  CHECK(unfitted.at(CostName::pair_us).source.find("was not run") != std::string::npos);
}

TEST_CASE("extrapolated counts equal measured ones at the same node count and are within 1 % of brute force at 64") {
  constexpr std::uint64_t seed = 7;
  INFO("seed ", seed);
  std::mt19937_64 random(seed);
  constexpr double extent = 2, side = 100;
  constexpr int objects = 20000;
  std::uniform_real_distribution<double> low(0, side - extent);
  std::vector<double> lows(3 * objects);
  for (double& value : lows) value = low(random);
  // Brute force: number of regions that all boxes overlap if the cube is cut into `slices` on each axis.
  const auto positions_in = [&](int slices) {
    double all = 0;
    for (int i = 0; i < objects; ++i) {
      double regions = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const double at = lows[static_cast<std::size_t>(3 * i + axis)];
        regions *= 1 + std::floor((at + extent) * slices / side) - std::floor(at * slices / side);
      }
      all += regions;
    }
    return all;
  };
  const auto counts_at = [&](int slices) {
    FrameCounts counts;
    counts.objects = counts.moved = objects;
    counts.users = 1;
    counts.user_hosted = objects;
    counts.nodes = std::pow(slices, 3);
    counts.tested = 30000;
    counts.busiest_tested = counts.tested / counts.nodes;
    const double records = positions_in(slices);
    counts[Traffic::m2] = {counts.nodes, records + counts.tested, records * 88 + counts.tested * 8};
    return counts;
  };
  const FrameCounts one = counts_at(1), eight = counts_at(2), sixty_four = counts_at(4);
  const FrameCounts same = extrapolated(one, eight, 8);
  CHECK(same[Traffic::m2].records == doctest::Approx(eight[Traffic::m2].records));
  CHECK(same.busiest_tested == doctest::Approx(eight.busiest_tested));
  const FrameCounts beyond = extrapolated(one, eight, 64);
  CHECK(beyond[Traffic::m2].records == doctest::Approx(sixty_four[Traffic::m2].records).epsilon(0.01));
  CHECK(beyond[Traffic::m2].messages == doctest::Approx(64));
  CHECK(beyond.tested == sixty_four.tested);
}

TEST_CASE("--cost replaces a cost by name, and an invalid one is refused with the list of names") {
  ClusterCosts costs = *find_cluster("2004");
  CHECK(check_cost("pair_us=50").empty());
  replace_costs(costs, {"pair_us=50", "latency_us=0.25"});
  CHECK(costs[CostName::pair_us] == 50);
  CHECK(costs[CostName::latency_us] == 0.25);
  CHECK_FALSE(costs.at(CostName::pair_us).fitted);
  for (const char* invalid : {"pair_us", "pair_us=", "pair_us=x", "pair_us=-1", "speed=1", "bandwidth_mbit=0", "=3",
                              "pair_us=nan", "pair_us=1x"}) {
    CHECK_MESSAGE(check_cost(invalid).find("expected NAME=VALUE") != std::string::npos, invalid);
  }
  CHECK(find_cluster("1999") == nullptr);
}

}  // namespace ringfence::tools
