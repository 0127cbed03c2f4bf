// Batches of queries that CD nodes in other processes answer.
#include <cstddef>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"
#include "facade/queries/batches.hpp"

namespace ringfence::test {

TEST_CASE("nodes in other processes answer batches as a snapshot does, also while one is lost and another joins") {
  for (const Deployment deployment : {Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      NodeWorld nodes(deployment, placement, 3);
      World& world = nodes.world();
      nodes.run(1);
      std::size_t found = 0, recomputed = 0;
      for (unsigned frame = 0; frame < 20; ++frame) {
        CAPTURE(frame);
        const std::vector<ShapeId> shapes{ShapeId(0)};
        const Queries queries = make_queries(world, shapes, NodeWorld::side, 20, frame);
        QueryBatch batch = batch_of(queries);
        if (frame % 5 != 4) REQUIRE(world.attach(batch) == Status::ok);
        if (frame == 8) nodes.process(0).signal(SIGKILL);
        if (frame == 12) nodes.start_node();
        nodes.run(1);
        if (frame % 5 == 4) continue;
        const Answers answers = answers_of(batch);
        CHECK((answers == answer(world.snapshot(), queries)));
        for (const Hit& hit : answers.hits) found += hit ? 1 : 0;
        recomputed += world.report().recomputed_batches;
        CHECK(world.report().recomputed_batches == (world.report().lost.empty() ? 0u : 1u));
      }
      CHECK(found > 100);
      CHECK(recomputed <= nodes.lost());
      CHECK(nodes.lost() >= 1);
      CHECK(nodes.is_right());
    }
  }
}

}  // namespace ringfence::test
