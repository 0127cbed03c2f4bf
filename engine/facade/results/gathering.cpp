#include "facade/results/gathering.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "nodes/host/model_failures.hpp"
#include "telemetry/track.hpp"

namespace ringfence::facade {

void gather_model_failures(FrameReport& report, const WorldState& state, const nodes::ServerRole& server,
                           const CdNodes& nodes, const UserNodes& users) {
  std::vector<ModelFailure> remote;
  if (state.config.remote_nodes != nullptr) {
    remote = state.config.remote_nodes->take_model_failures();
  }
  if (report.refused[static_cast<std::size_t>(Status::model_failed)] == 0) {
    return;
  }
  nodes::ModelFailures all = server.model_failures();
  nodes.pool().each([&](const PoolNode& node) {
    if (node.role != nullptr && !was_lost(report, node.id)) {
      all.add(node.role->host().failures().span());
    }
  });
  users.each([&](const User& user) { all.add(user.role.host().failures().span()); });
  all.add(remote);
  report.model_failures.assign(all.span().begin(), all.span().end());
}

void gather_timeline(FrameReport& report, WorldState& state, const CdNodes& nodes, const UserNodes& users) {
  report.timeline.clear();
  if (!state.config.timeline) {
    return;
  }
  std::uint32_t index = 0;
  const auto gather = [&](telemetry::Track* track) {
    for (TimelineSpan span : track != nullptr ? track->spans() : std::span<const TimelineSpan>()) {
      span.track = index;
      report.timeline.push_back(span);
    }
    if (track != nullptr) {
      track->clear();
    }
    ++index;
  };
  gather(&state.server_track);
  nodes.pool().each([&](const PoolNode& node) { gather(was_lost(report, node.id) ? nullptr : node.track.get()); });
  for (std::size_t thread = 0; thread < users.threads().size(); ++thread) {
    gather(&users.threads().at(thread).track);
  }
}

}  // namespace ringfence::facade
