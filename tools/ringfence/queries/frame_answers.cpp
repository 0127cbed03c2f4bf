#include "queries/frame_answers.hpp"

#include <chrono>

#include <fmt/format.h>

#include "exit_code.hpp"

namespace ringfence::tools {
namespace {

using worlds::QueryKind;
using worlds::QueryRow;

QueryFilter filter_of(const World& world, const QueryRow& row) {
  QueryFilter filter;
  filter.layers = row.layers;
  if (row.except != 0) filter.except = world.find(row.except);
  return filter;
}

/// Frames of the world include those of the warm-up.
QueryFrame frame_of(const World& world, const QueryRow& row) {
  if (!row.at) return std::nullopt;
  return *row.at + static_cast<double>(world.report().frame - row.frame);
}

template <class Batch, class Query>
void add(Batch& batch, const Query& query, std::size_t row) {
  batch.queries.push_back(query);
  batch.rows.push_back(row);
}

void check(const QueryRow& row, Status status) {
  if (status == Status::ok) return;
  throw IncompleteError(fmt::format("frame {}: query {} was refused: {}; earlier frames are complete", row.frame,
                                    row.query, name_of(status)));
}

}  // namespace

template <class Visit>
void FrameAnswers::each_batch(const Visit& visit) {
  visit(rays_), visit(any_rays_), visit(all_rays_), visit(sweeps_), visit(all_sweeps_), visit(overlaps_);
  visit(nearest_);
}

void FrameAnswers::add_row(const World& world, const QueryRow& row, std::size_t index) {
  const QueryFilter filter = filter_of(world, row);
  const QueryFrame frame = frame_of(world, row);
  const RayQuery ray{row.pose.position, row.displacement, filter, frame};
  const SweepQuery sweep{ShapeId(row.shape), row.pose, row.displacement, filter, frame};
  switch (row.kind) {
    case QueryKind::ray:
      return add(rays_, ray, index);
    case QueryKind::ray_any:
      return add(any_rays_, ray, index);
    case QueryKind::ray_all:
      return add(all_rays_, ray, index);
    case QueryKind::sweep:
      return add(sweeps_, sweep, index);
    case QueryKind::sweep_all:
      return add(all_sweeps_, sweep, index);
    case QueryKind::overlap:
      return add(overlaps_, OverlapQuery{ShapeId(row.shape), row.pose, filter, frame}, index);
    case QueryKind::nearest:
      return add(nearest_, NearestQuery{row.pose.position, row.distance, filter, frame}, index);
  }
}

void FrameAnswers::sort_into_batches(const World& world, std::span<const QueryRow> rows) {
  each_batch([](auto& batch) { batch.queries.clear(), batch.rows.clear(); });
  for (std::size_t i = 0; i < rows.size(); ++i) add_row(world, rows[i], i);
  rays_.answers.resize(rays_.queries.size());
  any_rays_.answers.resize(any_rays_.queries.size());
  sweeps_.answers.resize(sweeps_.queries.size());
  nearest_.answers.resize(nearest_.queries.size());
}

void FrameAnswers::run_batches(const World& world) {
  work_ = {};
  const auto start = std::chrono::steady_clock::now();
  const Snapshot frame = world.snapshot();
  frame.cast(rays_.queries, rays_.answers, &work_);
  frame.cast_any(any_rays_.queries, any_rays_.answers, &work_);
  frame.cast_all(all_rays_.queries, all_rays_.answers, &work_);
  frame.sweep(sweeps_.queries, sweeps_.answers, &work_);
  frame.sweep_all(all_sweeps_.queries, all_sweeps_.answers, &work_);
  frame.overlap(overlaps_.queries, overlaps_.answers, &work_);
  frame.nearest(nearest_.queries, nearest_.answers, &work_);
  ms_ = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

template <class Query>
void FrameAnswers::place_hits(std::span<const QueryRow> rows, const Batch<Query, std::vector<Hit>>& batch) {
  for (std::size_t i = 0; i < batch.rows.size(); ++i) {
    const Hit& hit = batch.answers[i];
    check(rows[batch.rows[i]], hit.status);
    places_[batch.rows[i]] = {hits_.size(), hit ? 1u : 0u};
    if (hit) hits_.push_back(hit);
  }
}

template <class Query>
void FrameAnswers::place_hits(std::span<const QueryRow> rows, const Batch<Query, std::vector<AnyHit>>& batch) {
  for (std::size_t i = 0; i < batch.rows.size(); ++i) {
    const AnyHit& hit = batch.answers[i];
    check(rows[batch.rows[i]], hit.status);
    places_[batch.rows[i]] = {hits_.size(), hit ? 1u : 0u};
    if (hit) hits_.emplace_back();
  }
}

template <class Query>
void FrameAnswers::place_hits(std::span<const QueryRow> rows, const Batch<Query, HitLists>& batch) {
  for (std::size_t i = 0; i < batch.rows.size(); ++i) {
    check(rows[batch.rows[i]], batch.answers.status(i));
    const std::span<const Hit> list = batch.answers[i];
    places_[batch.rows[i]] = {hits_.size(), list.size()};
    hits_.insert(hits_.end(), list.begin(), list.end());
  }
}

void FrameAnswers::collect(std::span<const QueryRow> rows) {
  hits_.clear();
  places_.assign(rows.size(), {});
  each_batch([&](const auto& batch) { place_hits(rows, batch); });
}

void FrameAnswers::answer(const World& world, std::span<const QueryRow> rows) {
  sort_into_batches(world, rows);
  run_batches(world);
  collect(rows);
}

}  // namespace ringfence::tools
