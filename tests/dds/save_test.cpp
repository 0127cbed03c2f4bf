// Worlds that are saved in one process and continue with nodes in others, and back.
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

using test::NodeWorld;

std::vector<std::byte> save(World& world) {
  MemorySink sink;
  REQUIRE(world.save(sink) == Status::ok);
  return sink.bytes();
}

// Phases too: contacts of the frame before the save persist, and end only where they end in the other world.
void advance_both(World& p, World& q) {
  REQUIRE(p.advance() == Status::ok);
  REQUIRE(q.advance() == Status::ok);
  const auto same = [](std::span<const Contact> a, std::span<const Contact> b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
  };
  REQUIRE(same(p.contacts(), q.contacts()));
  REQUIRE(same(p.ended(), q.ended()));
}

TEST_CASE(
    "a world continues with nodes in other processes, and from there in one process, as if nothing had happened") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    CAPTURE(name_of(deployment));
    const Placement placement = deployment == Deployment::user_server ? Placement::server : Placement::region;
    WorldConfig config = NodeWorld::config_of(deployment, placement);
    config.nodes = 0;
    World local(config);
    test::populate(local, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
    const ShapeId removed = local.add_shape(Sphere{3});
    for (int frame = 0; frame < 12; ++frame) REQUIRE(local.advance() == Status::ok);
    REQUIRE(local.remove_shape(removed) == Status::ok);
    REQUIRE(local.place(local.find(20), {{8, 8, 8}, {}}) == Status::ok);

    NodeWorld remote(deployment, placement, 2, {}, 0, NodeWorld::Model::bouncing, save(local));
    CHECK(remote.world().contacts().size() == local.contacts().size());
    for (int frame = 0; frame < 10; ++frame) advance_both(local, remote.world());
    const std::vector<std::byte> bytes = save(remote.world());
    CHECK(bytes == save(local));

    config.nodes = 2;
    MemorySource source(bytes);
    World back(config, source);
    for (int frame = 0; frame < 10; ++frame) advance_both(local, back);
    CHECK(local.contacts().size() > 10);
  }
}

TEST_CASE("a run continues from its journal with nodes in other processes, and these end if it is refused") {
  const test::TemporaryFolder folder;
  const std::string journal = folder / "journal", world = " --objects 300 --users 4 --warmup 2 --quiet ";
  const auto run = [](const std::string& arguments) {
    const test::ProgramResult answer = test::ringfence(arguments);
    CHECK_MESSAGE(answer.code == 0, answer.out);
    return test::digest_in(answer.out);
  };
  const std::string expected = run("run --frames 40" + world);
  (void)run("run --frames 20 --snapshot-every 7 --journal " + journal + world);
  const std::string processes = " --link dds --interface lo --domain 175 --nodes 2 --quiet --frames ";
  const test::ProgramResult refused = test::ringfence("resume " + journal + processes + "5");
  CHECK(refused.code == 2);
  CHECK(refused.out.find("--frames: found 5; expected at least 20") != std::string::npos);
  CHECK(run("resume " + journal + processes + "40") == expected);
}

}  // namespace
}  // namespace ringfence
