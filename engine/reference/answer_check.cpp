#include "reference/answer_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/floating_point.hpp"

namespace ringfence::reference {
namespace {

using Kind = Question::Kind;

bool is_admitted(const Question& question, const FrameObject& object) {
  return object.present && (question.layers >> object.layer & 1u) != 0 && object.number != question.except;
}

bool is_ray(const Question& question) { return &question.motion.shape == &point_shape(); }

double largest(const Vec3d& p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); }

/// The segment from `start` to `start + d`.
class Segment {
 public:
  Segment(const Vec3d& start, const Vector& d) : start_(start), d_(d) {
    const double square = dot(d, d);
    inverse_ = square > 1e-200 ? 1 / square : 0;  // shorter ones are points
  }

  bool is_within(double distance, const Vec3d& point) const {
    const Vector from = Vector(point) - start_;
    const Vector off = from - d_ * std::clamp(dot(from, d_) * inverse_, 0.0, 1.0);
    return dot(off, off) <= distance * distance;
  }

 private:
  Vector start_, d_;
  double inverse_;  ///< 1 / (d · d); 0 for points
};

std::string of_object(const FrameObject& object, const std::string& error) {
  return error.empty() ? error : "object " + std::to_string(object.number) + ": " + error;
}

/// The motion as far as a fraction.
Motion cut(const Motion& motion, double until) {
  return {motion.shape, motion.start, Vector(motion.displacement) * until};
}

}  // namespace

AnswerCheck::AnswerCheck(const Shapes& shapes, std::span<const FrameObject> objects, const Tolerance& tolerance)
    : shapes_(shapes), tolerance_(tolerance) {
  for (const FrameObject& object : objects) {
    if (object.present) balls_.push_back({object.pose.position, shape_of(object).bounding_radius, &object});
  }
  std::sort(balls_.begin(), balls_.end(),
            [](const Ball& p, const Ball& q) { return p.object->number < q.object->number; });
}

const FrameObject* AnswerCheck::find(const Question& question, const Hit& hit) const {
  const ObjectNumber number = hit.object.number();
  const auto at = std::lower_bound(balls_.begin(), balls_.end(), number,
                                   [](const Ball& ball, ObjectNumber n) { return ball.object->number < n; });
  if (at == balls_.end() || at->object->number != number || !is_admitted(question, *at->object)) return nullptr;
  return at->object;
}

/// The band of the two shapes, and the rounding of the coordinates.
double AnswerCheck::allowed(const Question& question, const FrameObject& object) const {
  const PreparedShape& shape = shape_of(object);
  const PreparedShape& other = is_ray(question) ? shape : question.motion.shape;
  const double coordinates = largest(object.pose.position) + largest(question.motion.start.position) +
                             largest(question.motion.displacement) + shape.bounding_radius + other.bounding_radius;
  return band(shape, other, tolerance_) + 4e-15 * coordinates;
}

template <class Visit>
std::string AnswerCheck::visit_near(const Question& question, double until, double reach, const Visit& visit) const {
  const Motion& motion = question.motion;
  const Vector d = Vector(motion.displacement) * until;
  const Segment segment(motion.start.position, d);
  const double rounding = 8e-15 * (largest(motion.start.position) + largest(d));
  const double added = motion.shape.bounding_radius + reach + 1e-3 + rounding;
  for (const Ball& ball : balls_) {
    if (!segment.is_within(1.001 * ball.radius + added, ball.centre) || !is_admitted(question, *ball.object)) continue;
    if (std::string error = visit(*ball.object); !error.empty()) return error;
  }
  return {};
}

std::string AnswerCheck::describe_error(const Question& question, std::span<const Hit> hits) const {
  const base::DefaultFloatingPoint floating_point;
  if (std::string error = describe_record_error(question, hits); !error.empty()) return error;
  switch (question.kind) {
    case Kind::first_hit:
      return describe_first_hit(question, hits.empty() ? nullptr : &hits.front());
    case Kind::any_hit:
      return describe_any_hit(question, !hits.empty());
    case Kind::nearest:
      return describe_nearest(question, hits.empty() ? nullptr : &hits.front());
    case Kind::all_hits:
    case Kind::overlap:
      break;
  }
  return describe_list(question, hits);
}

/// Errors of all but the geometry.
std::string AnswerCheck::describe_record_error(const Question& question, std::span<const Hit> hits) const {
  const bool is_list = question.kind == Kind::all_hits || question.kind == Kind::overlap;
  if (!is_list && hits.size() > 1) return "more than one hit";
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Hit& hit = hits[i];
    if (question.kind == Kind::any_hit) {
      if (hit != Hit()) return "an answer without an object has other fields";
      continue;
    }
    const FrameObject* const object = find(question, hit);
    const std::string name = "object " + std::to_string(hit.object.number());
    if (object == nullptr) return name + " is unknown, absent or left out";
    if (hit.object != ObjectId::of(object->number, object->generation)) return name + " has the wrong generation";
    if (hit.user_data != object->user_data) return name + " has the wrong user data";
    if (hit.child != 0 || (hit.triangle != 0 && shape_of(*object).kind != ShapeKind::mesh)) {
      return name + " has a child or triangle";
    }
    const auto key = [](const Hit& each) { return std::pair(each.fraction, each.object.number()); };
    if (i > 0 && !(key(hits[i - 1]) < key(hit))) return name + " is out of order";
    if (question.kind != Kind::nearest && hit.distance != 0) return name + " has a distance";
    const bool no_fraction = question.kind == Kind::overlap || question.kind == Kind::nearest;
    if (no_fraction && (hit.fraction != 0 || hit.normal != Vec3d())) return name + " has a fraction or normal";
    if (question.kind == Kind::overlap && hit.point != Vec3d()) return name + " has a point";
  }
  return {};
}

std::string AnswerCheck::describe_hit(const Question& question, const FrameObject& object, const Hit* hit) const {
  const double tolerance = allowed(question, object);
  if (question.kind == Kind::overlap) {
    return of_object(object, describe_overlap_error(shape_of(object), object.pose, question.motion.shape,
                                                    question.motion.start, hit != nullptr, tolerance));
  }
  ClaimedHit claimed;
  if (hit != nullptr) claimed = {hit->fraction, hit->normal, hit->point};
  return of_object(object, describe_hit_error(shape_of(object), object.pose, question.motion,
                                              hit != nullptr ? &claimed : nullptr, tolerance));
}

std::string AnswerCheck::describe_first_hit(const Question& question, const Hit* hit) const {
  const FrameObject* const found = hit != nullptr ? find(question, *hit) : nullptr;
  if (found != nullptr) {
    if (std::string error = describe_hit(question, *found, hit); !error.empty()) return error;
  }
  const double until = hit != nullptr ? hit->fraction : 1;
  const double speed = length(Vector(question.motion.displacement));
  return visit_near(question, until, 0, [&](const FrameObject& object) -> std::string {
    if (&object == found) return {};
    // Of several objects around the start, the one with the lowest number is the answer.
    if (until == 0 && object.number > found->number) return {};
    const double tolerance = allowed(question, object);
    const double before = hit == nullptr || speed == 0 ? until : std::max(0.0, until - tolerance / speed);
    const Motion motion = cut(question.motion, before);
    return of_object(object, describe_hit_error(shape_of(object), object.pose, motion, nullptr, tolerance));
  });
}

std::string AnswerCheck::describe_any_hit(const Question& question, bool hit) const {
  if (!hit) return describe_first_hit(question, nullptr);
  // A ball that has twice the tolerance as its radius is deeper than the tolerance in each object that the ray comes
  // near to. It is right if there is such an object.
  PreparedShape ball = question.motion.shape;
  const double radius = ball.core.radius;
  const std::string near = visit_near(question, 1, 0, [&](const FrameObject& object) {
    const double tolerance = allowed(question, object);
    ball.core.radius = radius + 2 * tolerance;
    const Motion motion{ball, question.motion.start, question.motion.displacement};
    return describe_hit_error(shape_of(object), object.pose, motion, nullptr, tolerance);
  });
  return near.empty() ? "extra: no object is near the ray" : std::string();
}

std::string AnswerCheck::describe_list(const Question& question, std::span<const Hit> hits) const {
  std::vector<ObjectNumber> numbers;
  for (const Hit& hit : hits) {
    if (std::string error = describe_hit(question, *find(question, hit), &hit); !error.empty()) return error;
    numbers.push_back(hit.object.number());
  }
  std::sort(numbers.begin(), numbers.end());
  if (std::adjacent_find(numbers.begin(), numbers.end()) != numbers.end()) return "an object is listed twice";
  return visit_near(question, 1, 0, [&](const FrameObject& object) -> std::string {
    if (std::binary_search(numbers.begin(), numbers.end(), object.number)) return {};
    return describe_hit(question, object, nullptr);
  });
}

std::string AnswerCheck::describe_nearest(const Question& question, const Hit* hit) const {
  const Vec3d& point = question.motion.start.position;
  const FrameObject* const found = hit != nullptr ? find(question, *hit) : nullptr;
  if (found != nullptr) {
    const ClaimedPoint claimed{hit->distance, hit->point};
    const std::string error = describe_nearest_error(shape_of(*found), found->pose, point, question.distance, &claimed,
                                                     allowed(question, *found));
    if (!error.empty()) return of_object(*found, error);
  }
  const double limit = hit != nullptr ? hit->distance : question.distance;
  return visit_near(question, 0, limit, [&](const FrameObject& object) -> std::string {
    if (&object == found) return {};
    return of_object(object, describe_nearest_error(shape_of(object), object.pose, point, limit, nullptr,
                                                    allowed(question, object)));
  });
}

}  // namespace ringfence::reference
