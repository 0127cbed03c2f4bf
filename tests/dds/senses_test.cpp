// Motion models that ask queries, on CD nodes in other processes.

#include <doctest/doctest.h>

#include "dds/node_world.hpp"

namespace ringfence::test {

TEST_CASE("models in other processes sense what they do in one thread, also while nodes are lost and join") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      NodeWorld nodes(deployment, placement, 3, {}, 0, NodeWorld::Model::sensing);
      nodes.run(8);
      CHECK(nodes.is_right());
      // Within a frame, so that objects are recovered whose models have asked already, or have not.
      nodes.run(1, [&] { nodes.process(0).signal(SIGKILL); });
      CHECK(nodes.run_until([&] { return nodes.lost() > 0; }));
      CHECK(nodes.is_right());
      nodes.start_node();
      CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 3; }));
      nodes.run(8);
      CHECK(nodes.is_right());
      CHECK(nodes.lost() == 1);
      // With what models sense the world is another one.
      CHECK(NodeWorld::expected(nodes.world().frames(), NodeWorld::Model::sensing) !=
            NodeWorld::expected(nodes.world().frames()));
    }
  }
}

TEST_CASE("the last node in another process is lost, and the server's thread computes what its models sense") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    CAPTURE(name_of(placement));
    NodeWorld nodes(Deployment::user_collision, placement, 1, {}, 0, NodeWorld::Model::sensing);
    nodes.run(5);
    nodes.process(0).signal(SIGKILL);
    CHECK(nodes.run_until([&] { return nodes.lost() > 0; }));
    nodes.run(5);
    CHECK(nodes.is_right());
  }
}

}  // namespace ringfence::test
