#include "facade/automatic_bounds.hpp"

#include <algorithm>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

nodes::Request spawn_at(Vec3d position) {
  nodes::Request request;
  request.spec.pose.position = position;
  return request;
}

bool contains(const WorldBounds& bounds, Vec3d p) {
  return bounds.min.x <= p.x && p.x <= bounds.max.x && bounds.min.y <= p.y && p.y <= bounds.max.y &&
         bounds.min.z <= p.z && p.z <= bounds.max.z;
}

TEST_CASE("only a configuration without bounds, whose nodes are in this process, leaves them to the World") {
  WorldConfig config;
  CHECK(has_automatic_bounds(config));
  config.bounds_max.z = 1;
  CHECK(!has_automatic_bounds(config));
}

TEST_CASE("automatic bounds are a cube around the objects, in any order of the objects") {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> x(-900, 1100), y(5, 1800), z(0, 12);
  std::vector<nodes::Request> requests;
  for (int i = 0; i < 500; ++i) requests.push_back(spawn_at({x(random), y(random), z(random)}));
  WorldBounds bounds, again;
  REQUIRE(choose_bounds(requests, bounds));
  for (const nodes::Request& request : requests) CHECK(contains(bounds, request.spec.pose.position));
  const double side = bounds.max.x - bounds.min.x;
  CHECK(side < 2400);
  CHECK(bounds.max.y - bounds.min.y == doctest::Approx(side));
  CHECK(bounds.max.z - bounds.min.z == doctest::Approx(side));
  std::shuffle(requests.begin(), requests.end(), random);
  REQUIRE(choose_bounds(requests, again));
  CHECK(again.min == bounds.min);
  CHECK(again.max == bounds.max);
}

TEST_CASE("a few objects far away do not widen automatic bounds") {
  std::vector<nodes::Request> requests;
  for (int i = 0; i < 100; ++i) requests.push_back(spawn_at({i % 10 * 3.0, i / 10 * 3.0, 0}));
  for (const double far : {1e15, -1e15, 1e6}) requests.push_back(spawn_at({far, -far, far}));
  WorldBounds bounds;
  REQUIRE(choose_bounds(requests, bounds));
  CHECK(bounds.max.x - bounds.min.x < 2000);
  for (int i = 0; i < 100; ++i) CHECK(contains(bounds, requests[i].spec.pose.position));
}

TEST_CASE("one object gets bounds of 16 m around it, and a cut without objects chooses none") {
  WorldBounds bounds;
  CHECK(!choose_bounds(std::span<const nodes::Request>(), bounds));
  nodes::Request connect;
  connect.kind = nodes::Request::Kind::connect;
  CHECK(!choose_bounds(std::span(&std::as_const(connect), 1), bounds));
  const nodes::Request spawn = spawn_at({100, 200, 300});
  REQUIRE(choose_bounds(std::span(&spawn, 1), bounds));
  CHECK(bounds.min == Vec3d{92, 192, 292});
  CHECK(bounds.max == Vec3d{108, 208, 308});
}

}  // namespace
}  // namespace ringfence::facade
