// Processes with another version, byte order or record layout announce themselves, and are refused on either side.
#include "dds/incompatible_peer.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "dds/description.hpp"
#include "dds/domain.hpp"
#include "dds/node_world.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

using test::Difference;

/// A cluster that an incompatible node tries to join.
struct IncompatiblePeerTest {
  std::vector<std::string> log;
  dds::Cluster cluster{[this] {
    dds::ClusterConfig config;
    config.network.domain = dds::NetworkConfig::any_domain;
    config.network.interface = "lo";
    config.network.lease_ms = test::lease_ms;
    config.log = [this](LogLevel, std::string_view line) { log.emplace_back(line); };
    return config;
  }()};

  test::Process peer(Difference difference, dds::NodeState state, const std::string& why) const {
    return test::Process({RINGFENCE_INCOMPATIBLE_PEER, std::to_string(cluster.domain()),
                          std::to_string(static_cast<std::uint32_t>(difference)),
                          std::to_string(static_cast<std::uint32_t>(state)), why});
  }
  /// No node may become assigned meanwhile.
  bool refuses() {
    return test::wait_until([&] {
      CHECK(cluster.remote_nodes()->arrivals().empty());
      return cluster.report().refused == 1;
    });
  }
  /// Publishes the World's terms, from which a node gets the World's number.
  void open() {
    RemoteNodes::WorldParameters terms;
    terms.config = &world_config;
    cluster.remote_nodes()->open(terms);
  }
  WorldConfig world_config;
  bool has_logged(const std::string& text) const {
    return std::any_of(log.begin(), log.end(),
                       [&](const std::string& line) { return line.find(text) != std::string::npos; });
  }
};

/// Publishes `record`, its first `bytes`, as the terms of a World that differs in `difference`; returns the output of a
/// node that waits for a World.
test::ProgramResult output_for(Difference difference, const dds::WorldTermsRecord& record, std::size_t bytes) {
  dds::NetworkConfig network;
  network.domain = dds::NetworkConfig::any_domain;
  network.interface = "lo";
  dds::Domain domain(network, dds::Side::world);
  domain.start_heartbeat(network.lease_ms);
  const dds::Entity writer = domain.writer(dds::Topic::terms, dds::liveliness_qos(network.lease_ms), {});
  char name[] = "peer";
  dds::TermsSample sample{};
  sample.world = 7;
  sample.version = dds::wire_version;
  dds::write_byte_order(sample.order);
  sample.layout = dds::fingerprint();
  sample.name = name;
  sample.bytes = dds::borrow(std::as_bytes(std::span(&record, 1)).first(bytes));
  test::make_incompatible(sample, difference);
  REQUIRE(dds_write(writer.get(), &sample) == DDS_RETCODE_OK);
  return test::ringfence("node --once --interface lo --domain " + std::to_string(domain.number()));
}

constexpr int bad_use = 2;

dds::WorldTermsRecord some_terms() {
  dds::WorldTermsRecord record;
  std::fill_n(record.bounds_max, 3, 10.0);
  record.lease_ms = test::lease_ms;
  record.max_objects = 1000;
  return record;
}

}  // namespace

TEST_CASE("a node with another version, byte order or record layout is not assigned, is counted and is logged") {
  for (const Difference difference : test::differences) {
    INFO("difference ", static_cast<std::uint32_t>(difference));
    IncompatiblePeerTest cluster_test;
    cluster_test.open();
    const test::Process peer = cluster_test.peer(difference, dds::NodeState::ready, "");
    CHECK(cluster_test.refuses());
    CHECK(cluster_test.has_logged(
        "node peer is refused: it has another version, byte order, record layout or release; install"));
  }
}

TEST_CASE("a node of another release with the same record layout is not assigned, and the log states what to do") {
  IncompatiblePeerTest cluster_test;
  cluster_test.open();
  const test::Process peer = cluster_test.peer(Difference::release, dds::NodeState::ready, test::other_release);
  CHECK(cluster_test.refuses());
  CHECK(cluster_test.has_logged(
      "node peer is refused: it has another version, byte order, record layout or release: release 9.8.7 (bits 6), the "
      "World's is " +
      dds::own_release() + "; install one release of ringfence on all machines"));
}

TEST_CASE("a World of another release is refused by a node, and the log states what to do") {
  const test::ProgramResult answer = output_for(Difference::release, some_terms(), sizeof(dds::WorldTermsRecord));
  CHECK(answer.code == bad_use);
  CHECK(answer.out.find("this node is \"ringfence " + dds::own_release() +
                        "\"; install one release of ringfence on all machines") != std::string::npos);
}

TEST_CASE("a node that is ready for another World of the domain is not assigned") {
  IncompatiblePeerTest cluster_test;
  cluster_test.open();
  // Announces itself as ready for another World with incarnation 4, then for this World with incarnation 6.
  const test::Process peer = cluster_test.peer(Difference::world, dds::NodeState::ready, "");
  std::vector<RemoteNodes::MemberId> ready;
  CHECK(test::wait_until([&] {
    ready = cluster_test.cluster.remote_nodes()->arrivals();
    return !ready.empty() && ready.back() == 6;
  }));
  CHECK(ready == std::vector<RemoteNodes::MemberId>{6});
}

TEST_CASE("a node that refuses the World is counted, and its reason is logged") {
  IncompatiblePeerTest cluster_test;
  cluster_test.open();
  const test::Process peer =
      cluster_test.peer(Difference::none, dds::NodeState::refused, "shape 3 has an unknown kind");
  CHECK(cluster_test.refuses());
  CHECK(cluster_test.has_logged("node peer is refused: shape 3 has an unknown kind"));
}

TEST_CASE("a World with another version, byte order or record layout is refused by a node, which logs it") {
  for (const Difference difference : test::differences) {
    INFO("difference ", static_cast<std::uint32_t>(difference));
    const test::ProgramResult result = output_for(difference, some_terms(), sizeof(dds::WorldTermsRecord));
    CHECK(result.code == bad_use);
    CHECK(result.out.find("has another version, byte order, record layout or release") != std::string::npos);
  }
}

TEST_CASE("a World whose terms have another size or another motion model is refused by a node, which logs it") {
  const test::ProgramResult shorter = output_for(Difference::none, some_terms(), sizeof(dds::WorldTermsRecord) - 8);
  CHECK(shorter.code == bad_use);
  CHECK(shorter.out.find("the World's terms: 232 bytes; expected 240") != std::string::npos);
  dds::WorldTermsRecord record = some_terms();
  record.has_model = 1;
  record.state_bytes = 16;
  const test::ProgramResult other = output_for(Difference::none, record, sizeof record);
  CHECK(other.code == bad_use);
  CHECK(other.out.find("motion model of the World") != std::string::npos);
}

}  // namespace ringfence
