#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "reference/contact_check.hpp"
#include "reference/frame_check.hpp"
#include "reference/query_check.hpp"
#include "ringfence/query.hpp"

namespace ringfence::reference {

/// A query about all objects of a frame.
struct Question {
  enum class Kind : std::uint8_t { first_hit, any_hit, all_hits, overlap, nearest };
  Kind kind = Kind::first_hit;
  /// A ray is the motion of point_shape(). Overlaps: the start only; nearest: the position of the start only.
  Motion motion;
  double distance = 0;                 ///< nearest: the largest distance, metres
  std::uint32_t layers = 0xffffffffu;  ///< bit i: objects of layer i
  ObjectNumber except = 0;             ///< leaves out this object; 0: none
};

/// Compares answers of the engine with all objects of a frame: every answered hit is right, and no object is missing.
///
/// Objects are culled by their bounding balls, the rest is tested exactly; see query_check.hpp. Shares no code with the
/// engine's queries. Threads: any number may check answers. Cost: about 5 ns for each object, and 40 separations for
/// each object whose ball the query reaches before its first hit.
class AnswerCheck {
 public:
  /// `objects` have distinct numbers, with shapes in `shapes`. Both must outlive the object.
  AnswerCheck(const Shapes& shapes, std::span<const FrameObject> objects, const Tolerance& tolerance = {});

  /// What is wrong with the hits of an answer; empty if they are right. Lists are complete, in the order of the
  /// contract of HitLists; first_hit and nearest have at most one hit; any_hit has one hit without an object, or none.
  /// In `hits` the triangle is not checked.
  std::string describe_error(const Question& question, std::span<const Hit> hits) const;

 private:
  struct Ball {
    Vec3d centre;
    double radius = 0;
    const FrameObject* object = nullptr;
  };

  const FrameObject* find(const Question& question, const Hit& hit) const;
  const PreparedShape& shape_of(const FrameObject& object) const { return shapes_[object.shape]; }
  double allowed(const Question& question, const FrameObject& object) const;
  /// Calls `visit(object)` for each object whose ball comes within the tolerance of the motion, until it returns text.
  template <class Visit>
  std::string visit_near(const Question& question, double until, double reach, const Visit& visit) const;

  std::string describe_record_error(const Question& question, std::span<const Hit> hits) const;
  std::string describe_hit(const Question& question, const FrameObject& object, const Hit* hit) const;
  std::string describe_first_hit(const Question& question, const Hit* hit) const;
  std::string describe_any_hit(const Question& question, bool hit) const;
  std::string describe_list(const Question& question, std::span<const Hit> hits) const;
  std::string describe_nearest(const Question& question, const Hit* hit) const;

  const Shapes& shapes_;
  Tolerance tolerance_;
  std::vector<Ball> balls_;  ///< of the objects that are present, by number
};

}  // namespace ringfence::reference
