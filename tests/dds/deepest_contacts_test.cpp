// WorldConfig::deepest_contacts with CD nodes in other processes.

#include <doctest/doctest.h>

#include "dds/node_world.hpp"

namespace ringfence::test {

TEST_CASE("nodes in other processes list the same deepest contacts as one thread, also while nodes are lost and join") {
  constexpr std::uint32_t limit = 1;
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      NodeWorld nodes(deployment, placement, 3, {}, 0, NodeWorld::Model::bouncing, {}, limit);
      nodes.run(8);
      CHECK(nodes.is_right());
      CHECK(nodes.world().report().unlisted > 0);
      nodes.run(1, [&] { nodes.process(0).signal(SIGKILL); });
      CHECK(nodes.run_until([&] { return nodes.lost() > 0; }));
      CHECK(nodes.is_right());
      nodes.start_node();
      CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 3; }));
      nodes.run(8);
      CHECK(nodes.is_right());
      CHECK(nodes.lost() == 1);
      CHECK(NodeWorld::expected(nodes.world().frames(), NodeWorld::Model::bouncing, limit) !=
            NodeWorld::expected(nodes.world().frames()));
    }
  }
}

}  // namespace ringfence::test
