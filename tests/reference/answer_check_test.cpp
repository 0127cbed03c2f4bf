// The check of answers finds what is missing, extra or wrong among all objects of a frame.
#include "reference/answer_check.hpp"

#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::reference_test {
namespace {

using reference::AnswerCheck;
using reference::FrameObject;
using reference::Motion;
using reference::point_shape;
using reference::Question;
using reference::Shapes;
using Kind = Question::Kind;

/// Balls of radius 1 with the numbers 1 to 3 at x = 3, 6 and 9; number 3 is in layer 1; number 4 at x = 0 is absent.
struct Row {
  std::vector<ShapeDescription> descriptions{Sphere{1}, Sphere{0.5f}};
  Shapes shapes{descriptions};
  std::vector<FrameObject> objects;
  Row() {
    for (const ObjectNumber number : {3u, 1u, 2u, 4u}) {
      FrameObject object;
      object.number = number;
      object.layer = number == 3 ? 1 : 0;
      object.present = number != 4;
      object.pose.position.x = number == 4 ? 0 : 3.0 * number;
      object.generation = 5;
      object.user_data = 10 + number;
      objects.push_back(object);
    }
  }

  std::string error_of(const Question& question, const std::vector<Hit>& hits) const {
    return AnswerCheck(shapes, objects).describe_error(question, hits);
  }
};

Hit hit_of(ObjectNumber number) {
  Hit hit;
  hit.object = ObjectId::of(number, 5);
  hit.user_data = 10 + number;
  return hit;
}

/// The hit of a ray from 0 along x, 10 m.
Hit ray_hit(ObjectNumber number) {
  Hit hit = hit_of(number);
  hit.fraction = 0.3 * number - 0.1;
  hit.normal = {-1, 0, 0};
  hit.point = {3.0 * number - 1, 0, 0};
  return hit;
}

Question ray(Kind kind) { return {kind, Motion{point_shape(), {}, {10, 0, 0}}}; }

TEST_CASE("the first hit of a ray is right only if no object is before it") {
  const Row row;
  Question question = ray(Kind::first_hit);
  CHECK(row.error_of(question, {ray_hit(1)}) == "");
  CHECK(row.error_of(question, {ray_hit(2)}).starts_with("object 1: missing before"));
  CHECK(row.error_of(question, {}).starts_with("object 1: missing"));
  CHECK(row.error_of(question, {ray_hit(1), ray_hit(2)}) == "more than one hit");
  Hit wrong = ray_hit(1);
  wrong.fraction += 0.01;
  CHECK(row.error_of(question, {wrong}).starts_with("object 1: "));
  wrong = ray_hit(1);
  wrong.user_data = 0;
  CHECK(row.error_of(question, {wrong}) == "object 1 has the wrong user data");
  wrong = ray_hit(1);
  wrong.object = ObjectId::of(1, 4);
  CHECK(row.error_of(question, {wrong}) == "object 1 has the wrong generation");
  wrong = ray_hit(1);
  wrong.triangle = 1;
  CHECK(row.error_of(question, {wrong}) == "object 1 has a child or triangle");
  wrong = ray_hit(1);
  wrong.object = ObjectId::of(4, 5);
  CHECK(row.error_of(question, {wrong}) == "object 4 is unknown, absent or left out");
  question.except = 1;
  CHECK(row.error_of(question, {ray_hit(2)}) == "");
  CHECK(row.error_of(question, {ray_hit(1)}) == "object 1 is unknown, absent or left out");
  question.layers = 2;
  CHECK(row.error_of(question, {ray_hit(3)}) == "");
}

TEST_CASE("of objects around the start of a ray, the one with the lowest number is the first hit") {
  Row row;
  for (FrameObject& object : row.objects) object.pose.position = {0.1 * object.number, 0, 0};
  const Question question = ray(Kind::first_hit);
  Hit hit = hit_of(1);
  hit.normal = {-1, 0, 0};
  CHECK(row.error_of(question, {hit}) == "");
  hit.object = ObjectId::of(2, 5);
  hit.user_data = 12;
  CHECK(row.error_of(question, {hit}).starts_with("object 1: missing"));
}

TEST_CASE("whether anything is hit is right within the tolerance") {
  const Row row;
  Question question = ray(Kind::any_hit);
  CHECK(row.error_of(question, {Hit()}) == "");
  CHECK(row.error_of(question, {}).starts_with("object 1: missing"));
  CHECK(row.error_of(question, {ray_hit(1)}) == "an answer without an object has other fields");
  const Question past{Kind::any_hit, Motion{point_shape(), {{0, 1.001, 0}, {}}, {10, 0, 0}}};
  CHECK(row.error_of(past, {}) == "");
  CHECK(row.error_of(past, {Hit()}) == "extra: no object is near the ray");
  const Question grazing{Kind::any_hit, Motion{point_shape(), {{0, 1.00005, 0}, {}}, {10, 0, 0}}};
  CHECK(row.error_of(grazing, {}) == "");
  CHECK(row.error_of(grazing, {Hit()}) == "");
}

TEST_CASE("a list of hits has each object once, in order") {
  const Row row;
  const Question question = ray(Kind::all_hits);
  CHECK(row.error_of(question, {ray_hit(1), ray_hit(2), ray_hit(3)}) == "");
  CHECK(row.error_of(question, {ray_hit(1), ray_hit(3)}).starts_with("object 2: missing"));
  CHECK(row.error_of(question, {ray_hit(2), ray_hit(1), ray_hit(3)}) == "object 1 is out of order");
  CHECK(row.error_of(question, {ray_hit(1), ray_hit(1)}) == "object 1 is out of order");
}

TEST_CASE("sweeps and overlaps have the objects that the shape reaches") {
  const Row row;
  const Question sweep{Kind::first_hit, Motion{row.shapes[1], {}, {10, 0, 0}}};
  Hit hit = ray_hit(1);
  hit.fraction = 0.15;
  CHECK(row.error_of(sweep, {hit}) == "");
  CHECK(row.error_of(sweep, {ray_hit(1)}) != "");
  const Question overlap{Kind::overlap, Motion{row.shapes[1], {{4.5, 0, 0}, {}}, {}}};
  CHECK(row.error_of(overlap, {hit_of(1), hit_of(2)}) == "");
  const Question nearer{Kind::overlap, Motion{row.shapes[1], {{4.4, 0, 0}, {}}, {}}};
  CHECK(row.error_of(nearer, {hit_of(1)}) == "");
  CHECK(row.error_of(nearer, {}).starts_with("object 1: missing"));
  CHECK(row.error_of(nearer, {hit_of(1), hit_of(2)}).starts_with("object 2: extra"));
  CHECK(row.error_of(nearer, {ray_hit(1)}) == "object 1 has a fraction or normal");
}

TEST_CASE("the nearest object is right only if no other is nearer") {
  const Row row;
  Question question{Kind::nearest, Motion{point_shape(), {{7, 0, 0}, {}}, {}}, 2};
  Hit two = hit_of(2), three = hit_of(3);
  two.point = {7, 0, 0};
  three.distance = 1;
  three.point = {8, 0, 0};
  CHECK(row.error_of(question, {two}) == "");
  CHECK(row.error_of(question, {three}).starts_with("object 2: missing"));
  CHECK(row.error_of(question, {}).starts_with("object 2: missing"));
  question.except = 2;
  CHECK(row.error_of(question, {three}) == "");
  question.distance = 0.9;
  CHECK(row.error_of(question, {}) == "");
  CHECK(row.error_of(question, {three}).starts_with("object 3: "));
}

}  // namespace
}  // namespace ringfence::reference_test
