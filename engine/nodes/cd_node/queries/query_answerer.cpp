#include "nodes/cd_node/queries/query_answerer.hpp"

#include <algorithm>
#include <array>

#include "telemetry/track.hpp"

namespace ringfence::nodes {

using telemetry::SpanTimer;

void QueryAnswerer::begin() {
  messages::NodeFrameStats& stats = state_.stats;
  stats.query_ns = stats.query_boxes = stats.query_tests = stats.query_failed_supports = 0;
  SpanTimer time(state_.setup.track, "queries", stats.query_ns);
  list_owned();
  part_.build(owned_, owned_.size(), {}, *state_.setup.shapes);
  state_.contacts.queries.hits.clear();
  next_ = 0;
  pending_ = true;
}

void QueryAnswerer::list_owned() {
  const RegionObjects& objects = state_.objects;
  const bool alone = state_.region.map().sole_owner() == state_.setup.node;
  owned_.clear();
  at_border_.clear();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    if (alone || objects.inner(i)) {
      add(i);
    } else {
      at_border_.push_back(i);
    }
  }
  add_at_border();
}

// A node that does not sweep has no bounds.
void QueryAnswerer::add_at_border() {
  constexpr std::size_t batch = 128;
  const RegionObjects& objects = state_.objects;
  const bool stored = !objects.bounds().empty();
  std::array<geometry::PlacedShape, batch> placed;
  std::array<geometry::Bounds, batch> bounds;
  for (std::size_t first = 0; first < at_border_.size(); first += batch) {
    const std::size_t count = std::min(batch, at_border_.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t known = at_border_[first + i];
      if (stored) {
        bounds[i] = objects.bounds()[known];
      }
      placed[i] = {&objects.bodies()[known].pose, objects.bodies()[known].shape};
    }
    if (!stored) {
      state_.setup.shapes->bounds(std::span(placed).first(count), *state_.setup.space, bounds.data());
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (state_.region.map().pair_owner(bounds[i], bounds[i]) == state_.setup.node) {
        add(at_border_[first + i]);
      }
    }
  }
}

void QueryAnswerer::add(std::uint32_t known) {
  const RegionObjects& objects = state_.objects;
  const narrow_phase::Body& body = objects.bodies()[known];
  const std::uint32_t group = objects.groups().empty() ? 0 : objects.groups()[known];
  owned_.push_back({body.pose, body.shape, body.number, body.generation, group, objects.slot(known),
                    static_cast<std::uint8_t>(body.layer), static_cast<std::uint8_t>(body.category), 0});
}

void QueryAnswerer::answer_some() {
  NodeQueries& shared = state_.contacts.queries;
  messages::NodeFrameStats& stats = state_.stats;
  SpanTimer time(state_.setup.track, "queries", stats.query_ns);
  const geometry::ShapeView shapes = state_.setup.shapes->view();
  const std::size_t end = std::min(next_ + queries_at_once, shared.queries.size());
  QueryWork work;
  answers_.add(part_, shapes, shared.queries, next_, end, shared.hits, work);
  next_ = end;
  stats.query_boxes += work.boxes;
  stats.query_tests += work.tests;
  stats.query_failed_supports += work.failed_supports;
  if (next_ == shared.queries.size()) {
    shared.frame = state_.frame;
    pending_ = false;
  }
}

}  // namespace ringfence::nodes
