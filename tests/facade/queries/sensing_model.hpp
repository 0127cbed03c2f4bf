#pragma once

#include <cstdint>
#include <mutex>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "facade/bouncing_world.hpp"

namespace ringfence::test {

/// What one object asked in one frame, and the answers.
struct SensedByObject {
  std::uint64_t frame = 0;
  ObjectId self;
  Vec3d position;
  RayQuery ray;
  SweepQuery sweep;
  OverlapQuery overlap;
  NearestQuery nearest;
  Hit cast, swept, near;
  AnyHit any;
  Status overlap_status = Status::ok;
  std::vector<Hit> overlaps;
  /// Whether the answers are the same.
  bool operator==(const SensedByObject& other) const {
    return cast == other.cast && swept == other.swept && near == other.near && any == other.any &&
           overlap_status == other.overlap_status && overlaps == other.overlaps;
  }
};

/// BouncingModel whose objects also ask queries and are moved a little by each answer, so that a wrong answer changes
/// the world. It notes all that is asked. Shapes 0 to 2 of the World are those of Script
/// and populate().
class SensingModel final : public BouncingModel {
 public:
  /// `notes`: whether take() is called.
  SensingModel(double side, double sense, bool notes = true) : BouncingModel(side), sense_(sense), notes_(notes) {}

  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    BouncingModel::move(frame, inputs, outputs);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if ((inputs[i].number + frame) % 4 != 0) continue;
      SensedByObject sensed = ask(frame, inputs[i]);
      Vec3d& position = outputs[i].pose.position;
      position.x += 0.05 * sensed.cast.fraction + 0.02 * sensed.near.distance;
      position.y += 0.05 * sensed.swept.fraction + (sensed.any ? 0.01 : 0);
      for (const Hit& hit : sensed.overlaps) position.z += 0.01 * static_cast<double>(hit.object.number() % 5);
      if (notes_) {
        const std::lock_guard lock(noting_);
        noted_.push_back(std::move(sensed));
      }
    }
  }

  /// What was asked since the last call, in no particular order.
  std::vector<SensedByObject> take() const {
    const std::lock_guard lock(noting_);
    return std::exchange(noted_, {});
  }

  /// How far a query of each kind may reach: a radius that the shape certainly has, and one that it does not exceed.
  static constexpr double least_radius[] = {0.7, 1.118, 1.0};
  static constexpr double most_radius[] = {0.7001, 1.1181, 1.0001};

 private:
  SensedByObject ask(std::uint64_t frame, const MotionInput& in) const {
    std::mt19937_64 random(frame << 32 | in.number);
    const auto uniform = [&](double from, double to) {
      return from + (to - from) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    const Vec3d& at = in.pose.position;
    // Some of these are beyond the distance.
    const auto near_by = [&] {
      const double reach = 0.65 * sense_;
      return Vec3d{at.x + uniform(-reach, reach), at.y + uniform(-reach, reach), at.z + uniform(-reach, reach)};
    };
    const auto between = [](const Vec3d& p, const Vec3d& q) { return Vec3d{q.x - p.x, q.y - p.y, q.z - p.z}; };
    SensedByObject out;
    out.frame = frame;
    out.self = in.senses->self();
    out.position = at;
    QueryFilter filter;
    if (random() % 2 == 0) filter.except = out.self;
    if (random() % 4 == 0) filter.layers = static_cast<std::uint32_t>(1 + random() % 3);
    if (random() % 4 == 0) filter.categories = static_cast<std::uint32_t>(1 + random() % 15);
    if (random() % 4 == 0) filter.except_group = static_cast<std::uint32_t>(random() % 4);
    const auto shape = [&] { return ShapeId(static_cast<std::uint32_t>(random() % 3)); };
    const Vec3d start = random() % 2 == 0 ? at : near_by();
    out.ray = {start, random() % 8 == 0 ? Vec3d{} : between(start, near_by()), filter};
    out.sweep = {shape(), {start, {0, 0.6f, 0, 0.8f}}, between(start, near_by()), filter};
    out.overlap = {shape(), {near_by(), {0.6f, 0, 0, 0.8f}}, filter};
    out.nearest = {near_by(), uniform(0, sense_), filter};
    out.cast = in.senses->cast(out.ray);
    out.any = in.senses->cast_any(out.ray);
    out.swept = in.senses->sweep(out.sweep);
    const SensedHits hits = in.senses->overlap(out.overlap);
    out.overlap_status = hits.status;
    out.overlaps.assign(hits.hits.begin(), hits.hits.end());
    out.near = in.senses->nearest(out.nearest);
    return out;
  }

  const double sense_;
  const bool notes_;
  mutable std::mutex noting_;
  mutable std::vector<SensedByObject> noted_;
};

}  // namespace ringfence::test
