#pragma once

#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include "ringfence/world.hpp"

namespace ringfence::test {

/// Invariants after every frame: each candidate was tested and its result accepted exactly once, and the counters agree
/// with the readable results.
inline void require_counts(const World& world) {
  const FrameReport& report = world.report();
  REQUIRE(report.frame + 1 == world.frames());
  REQUIRE(report.tested + report.carried == report.candidates);
  REQUIRE(report.accepted == report.candidates);
  REQUIRE(report.contacts == world.contacts().size());
  REQUIRE(report.ended == world.ended().size());
  std::uint64_t candidates = 0, tested = 0, carried = 0, contacts = 0;
  for (const NodeReport& node : report.nodes) {
    candidates += node.candidates;
    tested += node.tested;
    carried += node.carried;
    contacts += node.contacts;
  }
  REQUIRE(candidates == report.candidates);
  REQUIRE(tested == report.tested);
  REQUIRE(carried == report.carried);
  REQUIRE(contacts == report.contacts + report.unlisted);
  REQUIRE((report.unlisted == 0 || world.config().deepest_contacts != 0));
  std::uint64_t began = 0;
  for (std::size_t i = 0; i < world.contacts().size(); ++i) {
    const Contact& contact = world.contacts()[i];
    began += contact.phase == Phase::begin ? 1 : 0;
    REQUIRE(contact.a < contact.b);
    REQUIRE(contact.phase != Phase::end);
    if (i > 0) {
      const Contact& before = world.contacts()[i - 1];
      REQUIRE((before.a < contact.a || (before.a == contact.a && before.b < contact.b)));
    }
  }
  REQUIRE(began == report.began);
}

inline std::uint64_t refused(const World& world, Status reason) {
  return world.report().refused[static_cast<std::size_t>(reason)];
}

inline void require_nothing_refused(const World& world) {
  for (std::size_t reason = 0; reason < status_count; ++reason) {
    CAPTURE(name_of(static_cast<Status>(reason)));
    REQUIRE(world.report().refused[reason] == 0);
  }
}

/// Runs a whole frame in which nothing may be refused.
inline void advance(World& world) {
  REQUIRE(world.advance() == Status::ok);
  require_counts(world);
  require_nothing_refused(world);
}

inline std::string describe(const WorldConfig& config) {
  return std::string(name_of(config.deployment)) + ", broad phase " + name_of(config.placement) + ", " +
         std::to_string(config.nodes) + " nodes";
}

/// Calls `test(config)` for all deployments and placements at these node counts.
template <class Test>
void in_all_worlds(WorldConfig config, std::initializer_list<std::uint32_t> nodes, Test test) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::uint32_t count : nodes) {
        config.deployment = deployment;
        config.placement = placement;
        config.nodes = count;
        CAPTURE(describe(config));
        test(config);
      }
    }
  }
}

}  // namespace ringfence::test
