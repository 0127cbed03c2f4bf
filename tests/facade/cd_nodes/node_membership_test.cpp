// Which CD nodes join and leave at a cut, without a frame. tests/facade/resize_test.cpp has whole worlds.
#include "facade/cd_nodes/node_membership.hpp"

#include <cstddef>
#include <memory>
#include <set>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

using nodes::Request;
using Slots = std::vector<NodeNumber>;

/// Remote nodes that the test lets come and go.
class FakeNodes : public RemoteNodes {
 public:
  void open(const WorldParameters&) override {}
  void add_shape(ShapeNumber, const ShapeDescription&) override {}
  void remove_shape(ShapeNumber) override {}
  std::vector<ModelFailure> take_model_failures() override { return {}; }
  std::vector<MemberId> wait_for_nodes(std::uint32_t nodes) override {
    std::vector<MemberId> members;
    while (members.size() < nodes) members.push_back(members.size() + 1);
    return members;
  }
  std::vector<MemberId> arrivals() override { return ready; }
  bool is_leaving(MemberId member) override { return leaving.contains(member); }
  void assign(nodes::ServerRole&, std::span<const NodeAssignment> assignments, const regions::RegionMap&) override {
    assigned.clear();
    for (const NodeAssignment& assignment : assignments) assigned.push_back(assignment.member);
  }
  Steppable bridge() override { return Steppable::of(*this); }
  nodes::Step step() { return nodes::Step::idle; }
  void close() noexcept override {}

  std::vector<MemberId> ready;
  std::set<MemberId> leaving;
  std::vector<MemberId> assigned;  ///< by slot
};

WorldConfig config_with(std::uint32_t nodes, const std::shared_ptr<RemoteNodes>& remote = nullptr) {
  WorldConfig config;
  config.nodes = nodes;
  config.remote_nodes = remote;
  return config;
}

/// The slots that the requests of a cut name.
struct CutNodes {
  Slots joining;
  Slots leaving;
  bool partition = false;
};

struct Fixture {
  explicit Fixture(const WorldConfig& config)
      : state(config), requests(state.config, state.shapes), nodes(state), membership(state, nodes, requests) {
    state.start_server_thread();
    const regions::RegionMap map = state.first_map();
    nodes::ServerSetup setup = state.server_setup();
    setup.nodes = nodes.make_first(map);
    server = std::make_unique<nodes::ServerRole>(setup, map);
    nodes.connect(*server);
  }
  ~Fixture() { state.assign_server_thread({}); }

  CutNodes cut() {
    requests.forget_cut(state.order);
    requests.cut(state.order);
    membership.cut(*server);
    CutNodes cut;
    for (const Request& request : state.order.requests) {
      if (request.kind == Request::Kind::add_node) cut.joining.push_back(request.node);
      if (request.kind == Request::Kind::retire_node) cut.leaving.push_back(request.node);
      cut.partition |= request.kind == Request::Kind::partition;
    }
    return cut;
  }
  void lose(std::vector<NodeId> lost) {
    FrameReport report;
    report.lost = std::move(lost);
    membership.remove_gone(report, *server);
  }
  const NodePool& pool() const { return nodes.pool(); }

  WorldState state;
  Requests requests;
  CdNodes nodes;
  NodeMembership membership;
  std::unique_ptr<nodes::ServerRole> server;
};

TEST_CASE("the last resize before a cut counts: nodes join, or those that joined last leave") {
  Fixture fixture(config_with(0));
  CHECK(fixture.membership.resize(9, *fixture.server) == Status::ok);
  CHECK(fixture.membership.resize(4, *fixture.server) == Status::ok);
  const CutNodes more = fixture.cut();
  CHECK(more.joining == Slots{1, 2, 3});
  CHECK(more.leaving.empty());
  CHECK(more.partition);
  CHECK(fixture.pool().size() == 4);
  const CutNodes unchanged = fixture.cut();
  CHECK(unchanged.joining.empty());
  CHECK(!unchanged.partition);
  CHECK(fixture.membership.resize(2, *fixture.server) == Status::ok);
  const CutNodes fewer = fixture.cut();
  CHECK(fewer.joining.empty());
  CHECK(fewer.leaving == Slots{3, 2});
  CHECK(fewer.partition);
  CHECK(fixture.pool().size() == 4);  // until they have handed everything over
}

TEST_CASE("a number of nodes out of range is refused and counted") {
  Fixture fixture(config_with(0));
  for (const std::uint32_t count : {0u, 1025u}) {
    CHECK(fixture.membership.resize(count, *fixture.server) == Status::bad_number);
  }
  FrameReport report;
  fixture.requests.report_refused(report);
  CHECK(report.refused[static_cast<std::size_t>(Status::bad_number)] == 2);
  CHECK(!fixture.cut().partition);
}

TEST_CASE("nodes that leave in the frame of a loss leave in the next one") {
  Fixture fixture(config_with(0));
  CHECK(fixture.membership.resize(4, *fixture.server) == Status::ok);
  (void)fixture.cut();
  CHECK(fixture.membership.resize(2, *fixture.server) == Status::ok);
  (void)fixture.cut();
  fixture.lose({NodeId(0)});
  CHECK(fixture.pool().size() == 3);
  CHECK(fixture.cut().leaving == Slots{3});
}

TEST_CASE("when all nodes are lost, a new node joins at the next cut") {
  Fixture fixture(config_with(0));
  CHECK(fixture.membership.resize(2, *fixture.server) == Status::ok);
  (void)fixture.cut();
  fixture.lose({NodeId(0), NodeId(1)});
  CHECK(fixture.cut().joining == Slots{0});
  CHECK(fixture.pool().size() == 1);
  CHECK(fixture.pool().at(0)->id == 2);
  CHECK(fixture.pool().at(0)->worker == nullptr);
}

TEST_CASE("remote nodes join when they are ready and leave when they ask for it") {
  const auto remote = std::make_shared<FakeNodes>();
  Fixture fixture(config_with(2, remote));
  CHECK(remote->assigned == std::vector<RemoteNodes::MemberId>{1, 2});
  CHECK(!fixture.cut().partition);
  remote->ready = {7};
  remote->leaving = {1};
  const CutNodes cut = fixture.cut();
  CHECK(cut.joining == Slots{2});
  CHECK(cut.leaving == Slots{0});
  CHECK(cut.partition);
  CHECK(remote->assigned == std::vector<RemoteNodes::MemberId>{1, 2, 7});
}

TEST_CASE("a local node takes over when all remote nodes leave, and leaves when one arrives") {
  const auto remote = std::make_shared<FakeNodes>();
  Fixture fixture(config_with(1, remote));
  remote->leaving = {1};
  const CutNodes all_leave = fixture.cut();
  CHECK(all_leave.joining == Slots{1});
  CHECK(all_leave.leaving == Slots{0});
  REQUIRE(fixture.pool().at(1)->role != nullptr);
  fixture.lose({NodeId(0)});
  remote->ready = {5};
  const CutNodes arrival = fixture.cut();
  CHECK(arrival.joining == Slots{0});
  CHECK(arrival.leaving == Slots{1});
}

}  // namespace
}  // namespace ringfence::facade
