#include "queries/searcher.hpp"

#include <algorithm>

namespace ringfence::queries {
namespace {

using narrow_phase::OverlapTests;
using narrow_phase::PlacedRays;
using narrow_phase::QueryShape;

bool comes_first(double place, const FrameObject& object, double best_place, const FrameObject* best) noexcept {
  return best == nullptr || place < best_place || (place == best_place && object.number < best->number);
}

bool is_hit(const FrameMoment& moment, const AskedRay& asked, const FrameObject& object, const Pose& pose, double limit,
            narrow_phase::ShapeHit& hit) {
  return narrow_phase::cast_ray(moment.shapes, object.shape, pose, asked.ray, limit, hit);
}
bool is_hit(const FrameMoment& moment, const AskedShape& asked, const FrameObject& object, const Pose& pose,
            double limit, narrow_phase::ShapeHit& hit) {
  return narrow_phase::sweep_shape(moment.shapes, object.shape, pose, asked.shape, asked.path, limit, hit);
}

/// The same for the i-th of the placed rays.
bool is_placed_hit(const FrameMoment& moment, const AskedRay& asked, const FrameObject& object,
                   const PlacedRays& placed, std::size_t i, double limit, narrow_phase::ShapeHit& hit) {
  return narrow_phase::cast_ray(moment.shapes, object.shape, placed, i, asked.ray, limit, hit);
}
bool is_placed_hit(const FrameMoment& moment, const AskedShape& asked, const FrameObject& object,
                   const PlacedRays& placed, std::size_t i, double limit, narrow_phase::ShapeHit& hit) {
  return narrow_phase::sweep_shape(moment.shapes, object.shape, placed, i, asked.shape, asked.path, limit, hit);
}

const narrow_phase::Ray& path_of(const AskedRay& asked) noexcept { return asked.ray; }
const narrow_phase::Ray& path_of(const AskedShape& asked) noexcept { return asked.path; }
double radius_of_query(const AskedRay&) noexcept { return 0; }
double radius_of_query(const AskedShape& asked) noexcept {
  return double{asked.shape.shapes.row(asked.shape.shape).bounding_radius};
}

/// The test of a search for first hits. `keep(query, object, limit, is_hit)` keeps what `is_hit(limit, hit)` finds and
/// returns the limit from now on.
template <class Asked, class Keep>
struct FirstHitTest {
  const FrameMoment& moment;
  std::span<const Asked> asked;
  PlacedRays& placed;
  const Keep& keep;

  double operator()(std::size_t query, const FrameObject& object, const Pose& pose, double limit) const {
    return keep(query, object, limit, [&](double most, narrow_phase::ShapeHit& hit) {
      return is_hit(moment, asked[query], object, pose, most, hit);
    });
  }
  void place(std::size_t query, const FrameObject& object, const Pose& pose) const {
    const double size = double{moment.shapes.row(object.shape).bounding_radius} + radius_of_query(asked[query]);
    placed.add(path_of(asked[query]), pose, size);
  }
  void run() const { placed.run(); }
  static double last_place(double limit) noexcept { return limit * (1 + 0x1p-19); }
  double test_placed(std::size_t i, std::size_t query, const FrameObject& object, double limit) const {
    // A shape that does not move has no line.
    if (placed.misses(i) && path_of(asked[query]).length > 0) return limit;
    return keep(query, object, limit, [&](double most, narrow_phase::ShapeHit& hit) {
      return is_placed_hit(moment, asked[query], object, placed, i, most, hit);
    });
  }
};

template <class Asked, class Keep>
FirstHitTest(const FrameMoment&, std::span<const Asked>, PlacedRays&, const Keep&) -> FirstHitTest<Asked, Keep>;

/// The test of a search for nearest objects.
struct NearestTest {
  const FrameMoment& moment;
  std::span<const AskedPoint> asked;
  PlacedRays& placed;
  std::span<ObjectPoint> found;

  double operator()(std::size_t query, const FrameObject& object, const Pose& pose, double limit) const {
    narrow_phase::NearestPoint point;
    const bool is_near = find_nearest(moment.shapes, object.shape, pose, asked[query].point, limit, point);
    return keep(query, object, is_near, point, limit);
  }
  void place(std::size_t query, const FrameObject&, const Pose& pose) const {
    placed.add({asked[query].point, {}, {}, 0}, pose, 0);
  }
  void run() const { placed.run(); }
  /// Boxes are sorted by the squares of their distances.
  static double last_place(double limit) noexcept { return limit * limit * (1 + 0x1p-18); }
  double test_placed(std::size_t i, std::size_t query, const FrameObject& object, double limit) const {
    narrow_phase::NearestPoint point;
    const bool is_near = find_nearest(moment.shapes, object.shape, placed, i, asked[query].point, limit, point);
    return keep(query, object, is_near, point, limit);
  }
  double keep(std::size_t query, const FrameObject& object, bool is_near, const narrow_phase::NearestPoint& point,
              double limit) const {
    ObjectPoint& best = found[query];
    if (is_near && comes_first(point.distance, object, best.nearest.distance, best.object)) best = {&object, point};
    return best.object == nullptr ? limit : std::min(limit, best.nearest.distance);
  }
};

}  // namespace

template <class Part, class Asked>
void Searcher::find_first(const Part& part, const FrameMoment& moment, std::span<const Asked> asked,
                          std::span<ObjectHit> found, QueryWork& work) {
  const auto keep = [&](std::size_t query, const FrameObject& object, double most, const auto& is_hit) {
    ObjectHit& best = found[query];
    if (best.object != nullptr) most = std::min(most, best.hit.fraction);
    narrow_phase::ShapeHit hit;
    if (is_hit(most, hit) && comes_first(hit.fraction, object, best.hit.fraction, best.object)) best = {&object, hit};
    return best.object == nullptr ? most : best.hit.fraction;
  };
  search_.search<BlockSearch::Wanted::first>(part, moment, asked, work, FirstHitTest{moment, asked, placed_, keep});
}

template <class Part, class Asked>
void Searcher::find_all(const Part& part, const FrameMoment& moment, std::span<const Asked> asked, ListSink& found,
                        QueryWork& work) {
  start_lists();
  search_.search<BlockSearch::Wanted::all>(
      part, moment, asked, work, [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
        narrow_phase::ShapeHit hit;
        if (is_hit(moment, asked[query], object, pose, 1, hit)) {
          list(static_cast<std::uint32_t>(query), {&object, hit}, found);
        }
        return most;
      });
  finish_list(found);
}

template <class Part>
void Searcher::cast(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked,
                    std::span<ObjectHit> found, QueryWork& work) noexcept {
  find_first(part, moment, asked, found, work);
}

template <class Part>
void Searcher::sweep(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked,
                     std::span<ObjectHit> found, QueryWork& work) noexcept {
  find_first(part, moment, asked, found, work);
}

template <class Part>
void Searcher::cast_all(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked, ListSink& found,
                        QueryWork& work) {
  find_all(part, moment, asked, found, work);
}

template <class Part>
void Searcher::sweep_all(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked,
                         ListSink& found, QueryWork& work) {
  find_all(part, moment, asked, found, work);
}

template <class Part>
void Searcher::cast_any(const Part& part, const FrameMoment& moment, std::span<const AskedRay> asked,
                        std::span<bool> found, QueryWork& work) noexcept {
  const auto keep = [&](std::size_t query, const FrameObject&, double most, const auto& is_hit) {
    narrow_phase::ShapeHit hit;
    found[query] = is_hit(1, hit);
    return found[query] ? -1.0 : most;
  };
  search_.search<BlockSearch::Wanted::first>(part, moment, asked, work, FirstHitTest{moment, asked, placed_, keep});
}

template <class Part>
void Searcher::overlap(const Part& part, const FrameMoment& moment, std::span<const AskedShape> asked, ListSink& found,
                       QueryWork& work) {
  start_lists();
  std::size_t last = asked.size();
  search_.search<BlockSearch::Wanted::near>(
      part, moment, asked, work, [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
        const QueryShape& shape = asked[query].shape;
        const Vec3d& position = asked[query].path.start;
        const auto number = static_cast<std::uint32_t>(query);
        if (OverlapTests::tests(moment.shapes.row(object.shape).kind) &&
            OverlapTests::tests(moment.shapes.row(shape.shape).kind)) {
          if (query != last) overlap_tests_.set_query({position, shape.orientation}, shape.shape);
          last = query;
          overlap_tests_.add(pose, object.shape);
          tested_.push_back({number, &object});
          if (overlap_tests_.size() == OverlapTests::most) list_overlaps(moment.shapes, found);
          return most;
        }
        list_overlaps(moment.shapes, found);  // first, so that the lists stay in order
        narrow_phase::ShapeHit hit;
        if (narrow_phase::overlaps(moment.shapes, object.shape, pose, shape, position, hit.triangle)) {
          list(number, {&object, hit}, found);
        }
        return most;
      });
  list_overlaps(moment.shapes, found);
  finish_list(found);
}

void Searcher::list_overlaps(const geometry::ShapeView& shapes, ListSink& found) {
  const std::span<const std::uint8_t> results = overlap_tests_.run(shapes);
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (results[i] != 0) list(tested_[i].query, {tested_[i].object, {}}, found);
  }
  tested_.clear();
}

/// Discards what a call that threw has left.
void Searcher::start_lists() noexcept {
  list_.clear();
  tested_.clear();
  overlap_tests_.clear();
}

void Searcher::list(std::uint32_t query, const ObjectHit& hit, ListSink& found) {
  if (query != listed_query_) finish_list(found);
  listed_query_ = query;
  list_.push_back(hit);
}

void Searcher::finish_list(ListSink& found) {
  if (!list_.empty()) found.add(listed_query_, list_);
  list_.clear();
}

template <class Part>
void Searcher::nearest(const Part& part, const FrameMoment& moment, std::span<const AskedPoint> asked,
                       std::span<ObjectPoint> found, QueryWork& work) noexcept {
  search_.search<BlockSearch::Wanted::nearest>(part, moment, asked, work, NearestTest{moment, asked, placed_, found});
}

template void Searcher::cast(const FramePart&, const FrameMoment&, std::span<const AskedRay>, std::span<ObjectHit>,
                             QueryWork&) noexcept;
template void Searcher::sweep(const FramePart&, const FrameMoment&, std::span<const AskedShape>, std::span<ObjectHit>,
                              QueryWork&) noexcept;
template void Searcher::cast_any(const FramePart&, const FrameMoment&, std::span<const AskedRay>, std::span<bool>,
                                 QueryWork&) noexcept;
template void Searcher::nearest(const FramePart&, const FrameMoment&, std::span<const AskedPoint>,
                                std::span<ObjectPoint>, QueryWork&) noexcept;
template void Searcher::cast_all(const FramePart&, const FrameMoment&, std::span<const AskedRay>, ListSink&,
                                 QueryWork&);
template void Searcher::sweep_all(const FramePart&, const FrameMoment&, std::span<const AskedShape>, ListSink&,
                                  QueryWork&);
template void Searcher::overlap(const FramePart&, const FrameMoment&, std::span<const AskedShape>, ListSink&,
                                QueryWork&);

template void Searcher::cast(const SweptFrames&, const FrameMoment&, std::span<const AskedRay>, std::span<ObjectHit>,
                             QueryWork&) noexcept;
template void Searcher::sweep(const SweptFrames&, const FrameMoment&, std::span<const AskedShape>, std::span<ObjectHit>,
                              QueryWork&) noexcept;
template void Searcher::cast_any(const SweptFrames&, const FrameMoment&, std::span<const AskedRay>, std::span<bool>,
                                 QueryWork&) noexcept;
template void Searcher::nearest(const SweptFrames&, const FrameMoment&, std::span<const AskedPoint>,
                                std::span<ObjectPoint>, QueryWork&) noexcept;
template void Searcher::cast_all(const SweptFrames&, const FrameMoment&, std::span<const AskedRay>, ListSink&,
                                 QueryWork&);
template void Searcher::sweep_all(const SweptFrames&, const FrameMoment&, std::span<const AskedShape>, ListSink&,
                                  QueryWork&);
template void Searcher::overlap(const SweptFrames&, const FrameMoment&, std::span<const AskedShape>, ListSink&,
                                QueryWork&);

}  // namespace ringfence::queries
