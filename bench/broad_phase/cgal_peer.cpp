#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wconversion"
#include <CGAL/box_intersection_d.h>
#pragma GCC diagnostic pop

#include <memory>

#include "broad_phase/box_worlds.hpp"

namespace ringfence::bench {
namespace {

// CGAL's hybrid of streamed segment trees and scanning, on boxes that refer to bounds and hold an id.
class Box {
 public:
  using NT = std::uint32_t;
  using ID = std::size_t;
  Box() = default;
  Box(const geometry::Bounds& bounds, std::uint32_t slot) : bounds_(bounds), slot_(slot) {}
  static int dimension() { return 3; }
  ID id() const { return slot_; }
  NT min_coord(int axis) const { return bounds_.lower[axis]; }
  NT max_coord(int axis) const { return bounds_.upper[axis]; }

 private:
  geometry::Bounds bounds_{};
  std::uint32_t slot_ = 0;
};

class Cgal final : public PairFinder {
 public:
  const std::vector<geometry::CandidatePair>& pairs() override { return pairs_; }
  std::size_t find(const BoxFrames& world, std::size_t frame) override {
    boxes_.clear();
    pairs_.clear();
    for (std::uint32_t i = 0; i < world.present.size(); ++i) boxes_.emplace_back(world.frames[frame][i], i);
    CGAL::box_self_intersection_d(boxes_.begin(), boxes_.end(), [&](const Box& a, const Box& b) {
      pairs_.push_back({static_cast<std::uint32_t>(a.id()), static_cast<std::uint32_t>(b.id())});
    });
    return pairs_.size();
  }

 private:
  std::vector<Box> boxes_;
  std::vector<geometry::CandidatePair> pairs_;
};

}  // namespace

PairFinder* make_cgal(const BoxFrames&) { return new Cgal; }

}  // namespace ringfence::bench
