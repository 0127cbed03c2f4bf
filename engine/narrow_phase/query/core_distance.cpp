#include "narrow_phase/query/core_distance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "narrow_phase/query/double_double.hpp"
#include "narrow_phase/query/hull_point_distance.hpp"
#include "narrow_phase/query/simplex.hpp"

namespace ringfence::narrow_phase {
namespace {

constexpr int most_steps = 256;  ///< in each precision; a polytope takes about ten

double as_double(double value) noexcept { return value; }
double as_double(DoubleDouble value) noexcept { return value.high; }

/// The search in one precision.
template <class T>
class Search {
 public:
  template <class Start>
  Search(const ConvexCore& a, const ConvexCore& b, double limit, const Start& start)
      : a_(a), b_(b), simplex_(start), radii_(a.radius() + b.radius()), limit_(limit + radii_) {
    tolerance_ = distance_tolerance(a.reach() + b.reach(), a.is_exact() && b.is_exact());
  }

  /// Returns false if rounding ends the search before the distance is proven.
  bool run() {
    for (int step = 0; step < most_steps; ++step) {
      using std::sqrt;
      result_.upper = as_double(sqrt(simplex_.squared_distance()));
      if (result_.upper <= tolerance_) return finish(CoreDistance::Kind::touch, {});
      const Vec3d away = simplex_.direction();
      if (result_.upper <= radii_) return finish(CoreDistance::Kind::touch, -away);
      if (simplex_.size() == 4) break;  // the origin is inside, but not to the tolerance: its weights are not precise
      const SimplexVertex<T> next(a_.support(-away), b_.support(away));
      const double lower = dot(away, next.on_a - next.on_b);
      result_.along = lower;
      result_.lower = std::max(result_.lower, lower);
      if (lower > limit_) return finish(CoreDistance::Kind::beyond, -away);
      const bool is_proven = result_.upper - lower <= tolerance_ + 0x1p-49 * result_.upper;
      if (is_proven || simplex_.has(next) || !simplex_.add(next)) {
        finish(CoreDistance::Kind::apart, -away);
        return is_proven;
      }
    }
    const Vec3d away = simplex_.direction();
    result_.along = dot(away, a_.support(-away) - b_.support(away));
    finish(CoreDistance::Kind::apart, -away);
    return false;
  }

  const CoreDistance& result() const noexcept { return result_; }
  const Simplex<T>& simplex() const noexcept { return simplex_; }

 private:
  bool finish(CoreDistance::Kind kind, Vec3d normal) noexcept {
    result_.kind = kind;
    result_.normal = normal;
    result_.lower = std::min(result_.lower, result_.upper);  // `upper` may have decreased since, by rounding
    result_.on_a = simplex_.nearest_on_a();
    result_.on_b = simplex_.nearest_on_b();
    return true;
  }

  const ConvexCore& a_;
  const ConvexCore& b_;
  Simplex<T> simplex_;
  double radii_, limit_, tolerance_;
  CoreDistance result_;
};

SimplexVertex<double> first_vertex(const ConvexCore& a, const ConvexCore& b) {
  const Vec3d between = b.inner_point() - a.inner_point();
  const bool is_direction = dot(between, between) > 0;
  const Vec3d direction = is_direction ? between : Vec3d{1, 0, 0};
  return {a.support(direction), b.support(-direction)};
}

}  // namespace

CoreDistance core_distance(const ConvexCore& a, const ConvexCore& b, double limit) {
  CoreDistance found;
  if (a.hull() != nullptr && b.is_point() && hull_point_distance(a, b.inner_point(), b.radius(), limit, found)) {
    return found;
  }
  Search<double> search(a, b, limit, first_vertex(a, b));
  if (search.run() || !a.is_exact() || !b.is_exact()) return search.result();
  Search<DoubleDouble> precise(a, b, limit, search.simplex());
  precise.run();
  return precise.result();
}

}  // namespace ringfence::narrow_phase
