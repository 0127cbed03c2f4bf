#include "reference/frame_check.hpp"

#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include "reference/exact_contact.hpp"
#include "reference/random_shapes.hpp"

using namespace ringfence;
using namespace ringfence::reference;
using reference_test::Random;

namespace {

struct Frame {
  Shapes shapes;
  std::vector<FrameObject> objects;
  std::vector<std::uint32_t> masks;
  std::vector<Contact> contacts;

  std::vector<Difference> check() const { return check_frame(12, shapes, objects, masks, contacts); }

  /// Computes all contacts by testing every pair: no sweep, no boxes.
  void detect() {
    contacts.clear();
    for (const auto& p : objects) {
      for (const auto& q : objects) {
        if (p.number >= q.number || !p.present || !q.present) continue;
        if (!masks.empty() && !(masks[p.layer] >> q.layer & 1u)) continue;
        if (auto c = exact_contact(shapes[p.shape], p.pose, shapes[q.shape], q.pose)) {
          c->a = p.number, c->b = q.number;
          c->layer_a = p.layer, c->layer_b = q.layer;
          c->generation_a = p.generation, c->generation_b = q.generation;
          c->user_data_a = p.user_data, c->user_data_b = q.user_data;
          contacts.push_back(*c);
        }
      }
    }
    std::sort(contacts.begin(), contacts.end(), [](const auto& p, const auto& q) {
      return std::pair{p.a, p.b} < std::pair{q.a, q.b};
    });
  }
};

Frame crowd(std::uint64_t seed, std::size_t objects, Vector centre = {}) {
  Random random(seed);
  Frame out;
  for (int i = 0; i < 12; ++i) out.shapes.add(random.convex(1));
  out.shapes.add(random.mesh(3, 3));
  out.masks = {0b01, 0b10, 0b100};  // three layers, each collides with itself only
  const double side = 1.6 * std::cbrt(static_cast<double>(objects));
  for (std::size_t i = 0; i < objects; ++i) {
    FrameObject o;
    o.number = static_cast<ObjectNumber>(7 + 3 * ((i * 31) % objects));
    o.shape = static_cast<ShapeNumber>(random.below(out.shapes.size()));
    o.layer = static_cast<std::uint8_t>(random.one_in(5) ? 1 : 0);
    o.present = !random.one_in(20);
    o.generation = static_cast<std::uint32_t>(i + 100);
    o.user_data = i * 0x100000001u;
    o.pose = {centre + Vector{random.uniform(0, side), random.uniform(0, side), random.uniform(0, side)},
              random.orientation()};
    out.objects.push_back(o);
  }
  out.detect();
  return out;
}

void expect_one(const Frame& frame, const Contact& c, const char* text) {
  const auto differences = frame.check();
  REQUIRE(differences.size() == 1);
  CHECK(differences[0].a == c.a);
  CHECK(differences[0].b == c.b);
  CAPTURE(differences[0].text);
  CHECK(differences[0].text.find(text) != std::string::npos);
}

}  // namespace

TEST_CASE("a correct frame has no differences, near the origin and far from it") {
  for (const Vector centre : {Vector{}, Vector{1e6, -1e6, 1e6}}) {
    const Frame frame = crowd(41, 300, centre);
    CHECK(frame.contacts.size() > 100);
    CHECK(frame.check().empty());
  }
}

TEST_CASE("each removed contact is reported as missing") {
  Frame frame = crowd(42, 150);
  const auto all = frame.contacts;
  REQUIRE(all.size() > 30);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].depth < 1e-3) continue;
    frame.contacts = all;
    frame.contacts.erase(frame.contacts.begin() + static_cast<std::ptrdiff_t>(i));
    expect_one(frame, all[i], "missing: depth ");
  }
}

TEST_CASE("every other error in a contact is reported once") {
  Frame frame = crowd(43, 150);
  const auto all = frame.contacts;
  const std::size_t middle = all.size() / 2;
  const auto at = [&] { return frame.contacts.begin() + static_cast<std::ptrdiff_t>(middle); };

  frame.contacts.insert(at(), all[middle]);
  expect_one(frame, all[middle], "is listed twice");

  frame.contacts = all;
  std::swap(frame.contacts[middle], frame.contacts[middle + 1]);
  expect_one(frame, all[middle], "out of order");

  frame.contacts = all;
  frame.contacts[middle].phase = Phase::end;
  expect_one(frame, all[middle], "phase end");

  frame.contacts = all;
  frame.contacts[middle].depth += 0.01f;
  expect_one(frame, all[middle], "wrong depth");

  const auto expect_wrong = [&](const char* text, auto change) {
    frame.contacts = all;
    change(frame.contacts[middle]);
    expect_one(frame, all[middle], text);
  };
  expect_wrong("wrong arms", [](Contact& c) { c.arm_b.x = std::nextafter(c.arm_b.x, 1e9f); });
  expect_wrong("wrong ids", [](Contact& c) { ++c.generation_a; });
  expect_wrong("wrong user data", [](Contact& c) { ++c.user_data_b; });
  expect_wrong("wrong layers", [](Contact& c) { ++c.layer_a; });
  expect_wrong("reserved fields", [](Contact& c) { c.toi = 0.5f; });
  expect_wrong("reserved fields", [](Contact& c) { c.child_b = 1; });

  frame.contacts = all;
  Contact unknown_object = all[middle];
  unknown_object.b = 1'000'000;
  frame.contacts.push_back(unknown_object);
  std::sort(frame.contacts.begin(), frame.contacts.end(), [](const auto& p, const auto& q) {
    return std::pair{p.a, p.b} < std::pair{q.a, q.b};
  });
  expect_one(frame, unknown_object, "names an unknown object");
}

TEST_CASE("a contact between absent, static, grouped or distant objects, or of layers that do not collide, is extra") {
  Frame frame;
  frame.shapes.add(Sphere{1});
  frame.masks = {0b01, 0b10};
  frame.objects = {{1, 0, 0, true, {{0, 0, 0}, {}}}, {2, 0, 0, true, {{1, 0, 0}, {}}}};
  frame.detect();
  REQUIRE(frame.contacts.size() == 1);
  CHECK(frame.check().empty());
  const Contact c = frame.contacts[0];

  frame.objects[1].present = false;
  expect_one(frame, c, "extra: one of the two is absent");
  frame.objects[1].present = true;
  frame.objects[1].layer = 1;
  expect_one(frame, c, "extra: their layers do not collide");
  frame.objects[1].layer = 0;
  frame.objects[0].fixed = frame.objects[1].fixed = true;
  expect_one(frame, c, "extra: both are static");
  frame.objects[1].fixed = false;
  CHECK(frame.check().empty());
  frame.objects[0].group = frame.objects[1].group = 4'000'000'000;
  expect_one(frame, c, "extra: they are of one group");
  frame.objects[1].group = 1;
  CHECK(frame.check().empty());
  frame.objects[1].pose.position.x = 50;
  frame.contacts[0].arm_b = arm(frame.contacts[0].point, frame.objects[1].pose);
  expect_one(frame, c, "frame 12: pair 1-2 (sphere, sphere) extra: the two are 48 m apart");
}

TEST_CASE("phases follow from the contacts of two frames") {
  Frame frame = crowd(44, 60);
  const auto before = frame.contacts;
  REQUIRE(before.size() > 4);
  // The first pair ends, and the last pair begins.
  const std::vector<Contact> was(before.begin(), before.end() - 1);
  std::vector<Contact> now(before.begin() + 1, before.end());
  for (auto& c : now) c.phase = Phase::persist;
  now.back().phase = Phase::begin;
  std::vector<Contact> ended{before.front()};
  ended[0].phase = Phase::end;
  CHECK(check_phases(3, was, now, ended).empty());

  const auto one = [&](const std::vector<Contact>& n, const std::vector<Contact>& e, const char* text) {
    const auto differences = check_phases(3, was, n, e);
    REQUIRE(differences.size() == 1);
    CAPTURE(differences[0].text);
    CHECK(differences[0].text.find(text) != std::string::npos);
  };
  one(now, {}, "has no end");
  auto wrong = now;
  wrong.back().phase = Phase::persist;
  one(wrong, ended, "its phase is not begin");
  wrong = now;
  wrong.front().phase = Phase::begin;
  one(wrong, ended, "its phase is not persist");
  auto ends = ended;
  ends[0].depth += 1;
  one(now, ends, "differs from its last contact");
  ends = {ended[0], ended[0]};
  one(now, ends, "ends twice");
  ends = {ended[0], now.back()};
  ends[1].phase = Phase::end;
  one(now, ends, "without having been in contact");
}

namespace {

/// Spheres of radius 1 m at these places on the x axis, with all their contacts.
Frame row_of_balls(const std::vector<double>& places) {
  Frame out;
  out.shapes.add(Sphere{1});
  for (std::size_t i = 0; i < places.size(); ++i) {
    FrameObject object;
    object.number = static_cast<ObjectNumber>(i + 1);
    object.pose.position = {places[i], 0, 0};
    out.objects.push_back(object);
  }
  out.detect();
  return out;
}

std::vector<Difference> check_limited(const Frame& frame, std::size_t limit) {
  return check_frame(3, frame.shapes, frame.objects, frame.masks, frame.contacts, limit);
}

Frame without(Frame frame, ObjectNumber a, ObjectNumber b) {
  std::erase_if(frame.contacts, [&](const Contact& c) { return c.a == a && c.b == b; });
  return frame;
}

}  // namespace

TEST_CASE("with a limit a contact is missing only if it is among the deepest of an object, and extra if of neither") {
  // Depths: 1-2 1.5, 2-3 1.4, 3-4 1.5, 1-3 0.9, 2-4 0.9, 1-4 0.4.
  const Frame all = row_of_balls({0, 0.5, 1.1, 1.6});
  REQUIRE(all.contacts.size() == 6);
  CHECK(check_limited(all, 3).empty());
  auto extra = check_limited(all, 2);
  REQUIRE(extra.size() == 1);
  CHECK(extra[0].a == 1);
  CHECK(extra[0].b == 4);
  CHECK(extra[0].text.find("extra: not among the 2 deepest of either object") != std::string::npos);
  const Frame two = without(all, 1, 4);
  CHECK(check_limited(two, 2).empty());
  const auto missing = check_limited(without(two, 2, 4), 2);
  REQUIRE(missing.size() == 1);
  CHECK(missing[0].a == 2);
  CHECK(missing[0].b == 4);
  CHECK(missing[0].text.find("among the 2 deepest of an object") != std::string::npos);
  CHECK(check_limited(without(two, 1, 2), 2).size() == 1);
}

TEST_CASE("with a limit a contact may be missing or listed if the depths differ by less than the band") {
  // 2 is as deep in 1 as in 3, except for a ten millionth.
  const Frame all = row_of_balls({0, 1, 2.0000001, 3.2});
  REQUIRE(all.contacts.size() == 3);
  CHECK(check_limited(all, 1).empty());
  CHECK(check_limited(without(all, 1, 2), 1).size() == 1);  // 1 has no other
  const Frame star = row_of_balls({0, 0.7, -0.7000001});
  REQUIRE(star.contacts.size() == 3);
  CHECK(check_limited(without(star, 2, 3), 1).empty());
  CHECK(check_limited(star, 1).size() == 1);
}
