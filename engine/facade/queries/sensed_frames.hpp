#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "geometry/shape_table.hpp"
#include "nodes/server/server_role.hpp"
#include "queries/recorded_frame.hpp"

namespace ringfence::facade {

/// The frame that motion models may ask queries about: the one before the frame that is running, with its index.
///
/// It is recorded when a frame begins, with the shapes that are registered then: so what models can ask depends neither
/// on snapshots nor on the history. Threads: the one that calls World. Memory: one frame, used again; another one for
/// each frame in which a role was lost, until its thread has ended. Throws only std::bad_alloc.
class SensedFrames {
 public:
  /// `distance`: WorldConfig::sense, metres; 0: models ask nothing, and nothing is recorded.
  SensedFrames(std::shared_ptr<const geometry::ShapeTable> shapes, double distance)
      : shapes_(std::move(shapes)), order_(std::make_shared<queries::LastOrder>()), distance_(distance) {}

  /// A frame begins: returns the frame before it, or null if models ask nothing, or there is none. `frames`: number of
  /// frames that are complete.
  const queries::RecordedFrame* prepare(const nodes::ServerRole& server, std::uint64_t frames);
  /// The frame is complete. `any_lost`: a CD node was lost in it or a user node was late, and its thread may still read
  /// the frame before.
  void finish(bool any_lost);
  /// Whether frames are kept for such threads.
  bool has_abandoned() const noexcept { return !abandoned_.empty(); }
  /// Precondition: all such threads have ended, and no frame is running.
  void free_abandoned() noexcept { abandoned_.clear(); }

 private:
  const std::shared_ptr<const geometry::ShapeTable> shapes_;
  const std::shared_ptr<queries::LastOrder> order_;
  const double distance_;
  std::unique_ptr<queries::RecordedFrame> frame_;
  std::vector<std::unique_ptr<queries::RecordedFrame>> abandoned_;
};

}  // namespace ringfence::facade
