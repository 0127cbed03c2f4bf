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
  copy_objects();
  list_owned();
  const queries::KnownBounds known = known_bounds();
  built_frame_ = none;
  part_.build_again({rows_, row_of_, owned_, groups_}, *state_.setup.shapes, known);
  built_frame_ = state_.frame;
  state_.contacts.queries.hits.clear();
  next_ = 0;
  pending_ = true;
}

void QueryAnswerer::copy_objects() {
  const RegionObjects& objects = state_.objects;
  rows_.assign(objects.bodies().begin(), objects.bodies().end());
  slots_.assign(objects.slots().begin(), objects.slots().end());
  groups_.assign(objects.groups().begin(), objects.groups().end());
  bounds_.resize(objects.bounds().size());
  for (std::size_t i = 0; i < bounds_.size(); ++i) {
    bounds_[i] = {objects.bounds()[i], queries::margin_of(state_.setup.shapes->row(rows_[i].shape))};
  }
}

void QueryAnswerer::list_owned() {
  const RegionObjects& objects = state_.objects;
  const bool alone = state_.region.map().sole_owner() == state_.setup.node;
  owned_ = 0;
  row_of_.assign(objects.size(), queries::FrameRows::none);
  at_border_.clear();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    if (alone || objects.inner(i)) {
      own(i);
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
        own(at_border_[first + i]);
      }
    }
  }
}

queries::KnownBounds QueryAnswerer::known_bounds() {
  if (bounds_.empty()) return {};
  // Boxes are most precise near the origin: it is a place among the objects.
  const Vec3d& place = rows_[0].pose.position;
  if (!box_of_ || !queries::is_near_origin(*box_of_, place)) {
    box_of_.emplace(*state_.setup.space, place);
    built_frame_ = none;
  }
  queries::KnownBounds known{bounds_.span(), &*box_of_, state_.objects.changed(), {}};
  // In the frame before, objects may have changed after its queries.
  if (built_frame_ != none && state_.frame - built_frame_ <= base::max_stamp_age) {
    known.built = base::stamp_of(built_frame_ - 1);
  }
  return known;
}

void QueryAnswerer::answer_some() {
  NodeQueries& shared = state_.contacts.queries;
  messages::NodeFrameStats& stats = state_.stats;
  SpanTimer time(state_.setup.track, "queries", stats.query_ns);
  const geometry::ShapeView shapes = state_.setup.shapes->view();
  const std::size_t end = std::min(next_ + queries_at_once, shared.queries.size());
  QueryWork work;
  answers_.add(part_, slots_, shapes, shared.queries, next_, end, shared.hits, work);
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
