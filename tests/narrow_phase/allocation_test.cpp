#include <atomic>
#include <cstdlib>
#include <new>

#include <doctest/doctest.h>

#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"
#include "narrow_phase/query/query_world.hpp"

// Counts all allocations of the program; only the tests below read the count.
namespace {
std::atomic<std::size_t> allocations{0};
}

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
// std::stable_sort calls this one.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

using namespace ringfence;
using namespace ringfence::narrow_phase_test;

TEST_CASE("meshes are tested without allocation") {
  for (const ShapeKind kind :
       {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh}) {
    INFO(name_of(kind));
    const PairWorld world = degenerate_mesh_pairs(kind, 300, 22);
    narrow_phase::NarrowPhase narrow_phase(world.shapes());
    const std::size_t contacts = narrow_phase.test(world.bodies, world.pairs).size();
    const std::size_t before = allocations;
    CHECK(narrow_phase.test(world.bodies, world.pairs).size() == contacts);
    CHECK(allocations == before);
  }
}

TEST_CASE("in steady state nothing is allocated") {
  for (const auto& [p, q] : {std::pair{ShapeKind::sphere, ShapeKind::box},
                             {ShapeKind::box, ShapeKind::box},
                             {ShapeKind::capsule, ShapeKind::capsule}}) {
    PairWorld world = degenerate_pairs(p, q, 6000, 21);
    narrow_phase::NarrowPhase narrow_phase(world.shapes());
    const std::size_t contacts = narrow_phase.test(world.bodies, world.pairs).size();
    const std::size_t before = allocations;
    CHECK(narrow_phase.test(world.bodies, world.pairs).size() == contacts);
    CHECK(narrow_phase.test(world.bodies, std::span(world.pairs).first(17)).size() <= 17);
    CHECK(narrow_phase.test(world.bodies, {}).empty());
    CHECK(allocations == before);
  }
}

TEST_CASE("in steady state queries allocate nothing") {
  for (const ShapeKind kind : {ShapeKind::sphere, ShapeKind::box, ShapeKind::hull, ShapeKind::mesh}) {
    INFO(name_of(kind));
    const QueryWorld world = make_queries(kind, ShapeKind::hull, true, 200, 23);
    const geometry::ShapeView shapes = world.pairs.shapes().view();
    const auto ask_all = [&] {
      for (const QueryCase& query : world.cases) {
        const narrow_phase::Body &body = world.target(query), &moving = world.moving(query);
        const narrow_phase::QueryShape shape{shapes, moving.shape, moving.pose.orientation};
        const narrow_phase::Ray ray = narrow_phase::Ray::along(query.start, query.displacement);
        narrow_phase::ShapeHit hit;
        narrow_phase::NearestPoint nearest;
        std::uint32_t triangle = 0;
        cast_ray(shapes, body.shape, body.pose, ray, 1, hit);
        sweep_shape(shapes, body.shape, body.pose, shape, ray, 1, hit);
        narrow_phase::overlaps(shapes, body.shape, body.pose, shape, query.start, triangle);
        find_nearest(shapes, body.shape, body.pose, query.start, 1e9, nearest);
      }
    };
    ask_all();  // Kernels prepare constants at their first call.
    const std::size_t before = allocations;
    ask_all();
    CHECK(allocations == before);
  }
}
