#include <cstddef>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/cluster.hpp"
#include "ringfence/world.hpp"

using namespace ringfence;

namespace {

/// The names of the first `count` values of an enumeration.
template <class Enumeration>
std::vector<std::string> names(std::size_t count) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < count; ++i) all.emplace_back(name_of(static_cast<Enumeration>(i)));
  return all;
}

using Names = std::vector<std::string>;

static_assert(static_cast<std::size_t>(ShapeKind::support) + 1 == shape_kinds);
static_assert(static_cast<std::size_t>(Stage::notify) + 1 == stage_count);
static_assert(static_cast<std::size_t>(Traffic::control) + 1 == traffic_count);
static_assert(static_cast<std::size_t>(NodeStage::publication) + 1 == node_stage_count);
static_assert(static_cast<std::size_t>(Status::journal_failed) + 1 == status_count);

}  // namespace

// Scene files, options, JSON keys and logs have these names, so they do not change.
TEST_CASE("every enumeration of the public API has a name for each value") {
  CHECK(names<Category>(4) == Names{"avatar", "active", "non-active", "static"});
  CHECK(names<Phase>(3) == Names{"begin", "persist", "end"});
  CHECK(names<ShapeKind>(shape_kinds) == Names{"sphere", "box", "capsule", "hull", "mesh", "support"});
  CHECK(names<Deployment>(3) == Names{"user", "user-server", "user-collision"});
  CHECK(names<Placement>(3) == Names{"server", "region", "auto"});
  CHECK(names<BalanceBy>(2) == Names{"cpu", "pairs"});
  CHECK(names<LogLevel>(4) == Names{"debug", "info", "warning", "error"});
  CHECK(names<Stage>(stage_count) ==
        Names{"move", "ingest", "broad_phase", "dispatch", "narrow_phase", "collect", "notify"});
  CHECK(names<Traffic>(traffic_count) == Names{"m1", "m2", "m3", "m4", "m5", "state", "control"});
  CHECK(names<NodeStage>(node_stage_count) == Names{"moving", "gathering", "colliding", "ending", "handing_over",
                                                    "settling", "reporting", "model", "kernel", "gate", "hand_over",
                                                    "publication"});
  CHECK(names<Status>(status_count) == Names{"ok",
                                             "stale_object",
                                             "not_host",
                                             "not_finite",
                                             "not_unit",
                                             "unknown_user",
                                             "unknown_shape",
                                             "unknown_layer",
                                             "number_in_use",
                                             "bad_number",
                                             "over_capacity",
                                             "bad_message",
                                             "out_of_order",
                                             "bad_category",
                                             "late",
                                             "model_failed",
                                             "over_quota",
                                             "out_of_memory",
                                             "no_thread",
                                             "support_failed",
                                             "shape_in_use",
                                             "bad_shape",
                                             "frame_expired",
                                             "not_written",
                                             "beyond_sense",
                                             "journal_failed"});
  CHECK(names<dds::MemberChange::Kind>(3) == Names{"joined", "left", "lost"});
  CHECK(names<dds::ExitReason>(4) == Names{"drained", "dismissed", "abandoned", "refused"});
}
