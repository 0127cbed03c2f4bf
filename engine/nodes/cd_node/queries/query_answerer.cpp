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
  const Vec3d origin = owned_ == 0 ? Vec3d{} : rows_[first_owned_].pose.position;
  find_bounds();
  const queries::BoxConverter box_of(*state_.setup.space, origin);
  part_.build_again(rows_.span(), owned_, *state_.setup.shapes, {bounds_.span(), &box_of});
  state_.contacts.queries.hits.clear();
  next_ = 0;
  pending_ = true;
}

void QueryAnswerer::list_owned() {
  const RegionObjects& objects = state_.objects;
  const bool alone = state_.region.map().sole_owner() == state_.setup.node;
  rows_.resize(objects.size());
  owned_ = 0;
  at_border_.clear();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    rows_[i].number = 0;
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
  rows_[known] = {body.pose,
                  body.shape,
                  body.number,
                  body.generation,
                  group,
                  objects.slot(known),
                  static_cast<std::uint8_t>(body.layer),
                  static_cast<std::uint8_t>(body.category),
                  0};
  first_owned_ = owned_++ == 0 ? known : first_owned_;
}

void QueryAnswerer::find_bounds() {
  const std::span<const geometry::Bounds> known = state_.objects.bounds();
  bounds_.resize(known.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    const bool owned = rows_[i].number != 0;
    bounds_[i] = {known[i], owned ? queries::margin_of(state_.setup.shapes->row(rows_[i].shape)) : -1};
  }
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
