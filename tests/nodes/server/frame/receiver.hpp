#pragma once

#include "nodes/server/frame/node_ingest.hpp"
#include "nodes/server/frame/user_ingest.hpp"
#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {

/// A server that waits for the states of its roles, and what reads their messages.
struct Receiver {
  explicit Receiver(const FixtureConfig& config = {}) : fixture(config) { state().stage = FrameStage::moving; }
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  void await(UserNumber user) {
    fixture.connect(user);
    state().await_users();
  }
  messages::StateRecord record(std::uint32_t slot, const Vec3d& position) {
    messages::StateRecord record;
    record.object = objects().row(slot).object;
    record.pose.position = position;
    return record;
  }
  messages::NodeStateRecord node_record(std::uint32_t slot, const Vec3d& position, std::uint32_t flags) {
    messages::NodeStateRecord record;
    record.object = objects().row(slot).object;
    record.object.flags |= flags;
    record.pose.position = position;
    record.bounds = state().setup.shapes->bounds(0, record.pose, *state().setup.space);
    return record;
  }
  std::uint64_t refused(Status reason) { return state().report().refused[static_cast<std::size_t>(reason)]; }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  NodeIngest nodes{fixture.state(), fixture.exchange(), states, statistics};
  UserIngest users{fixture.state(), statistics};
};

}  // namespace ringfence::nodes::test
