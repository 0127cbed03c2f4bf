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
  resize(state_.objects.size());
  list_owned();
  set_origin();
  kept_frame_ = none;
  part_.build_again(rows_.span(), owned_, *state_.setup.shapes, {bounds_.span(), &*box_of_, changed_});
  kept_frame_ = state_.frame;
  state_.contacts.queries.hits.clear();
  next_ = 0;
  pending_ = true;
}

void QueryAnswerer::resize(std::size_t objects) {
  is_kept_ = kept_frame_ != none && state_.frame - kept_frame_ <= base::max_stamp_age;
  if (!is_kept_) is_owned_.clear();
  rows_.resize(objects);
  bounds_.resize(state_.objects.bounds().size());
  is_owned_.resize(objects);
  changed_.assign(objects, is_kept_ ? std::uint8_t{0} : std::uint8_t{1});
}

void QueryAnswerer::list_owned() {
  const RegionObjects& objects = state_.objects;
  const bool alone = state_.region.map().sole_owner() == state_.setup.node;
  // In that frame, objects may have changed after its queries.
  const base::FrameStamp kept = base::stamp_of(kept_frame_ - 1);
  owned_ = 0;
  at_border_.clear();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    if (is_kept_ && !base::may_have_changed(objects.changed()[i], kept)) {
      owned_ += is_owned_[i];
      continue;
    }
    clear(i);
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

void QueryAnswerer::clear(std::uint32_t known) {
  rows_[known].number = 0;
  is_owned_[known] = 0;
  changed_[known] = 1;
  if (!bounds_.empty()) bounds_[known].margin = -1;
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
  is_owned_[known] = 1;
  ++owned_;
  if (!bounds_.empty()) {
    bounds_[known] = {objects.bounds()[known], queries::margin_of(state_.setup.shapes->row(body.shape))};
  }
}

/// Boxes are most precise near the origin: it is a place among the objects.
void QueryAnswerer::set_origin() {
  const auto owned = std::find(is_owned_.begin(), is_owned_.end(), 1);
  const bool any = owned != is_owned_.end();
  const Vec3d place = any ? rows_[static_cast<std::size_t>(owned - is_owned_.begin())].pose.position : Vec3d{};
  if (box_of_ && (!any || queries::is_near_origin(*box_of_, place))) return;
  box_of_.emplace(*state_.setup.space, place);
  std::fill(changed_.begin(), changed_.end(), std::uint8_t{1});
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
