#pragma once

#include <span>
#include <vector>

#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// The failures of the motion model in one frame: those of the objects with the lowest numbers. So several lists can be
/// merged, and the result does not depend on which roles host the objects.
///
/// Threads: belongs to its role; read by others between frames. Memory: none as long as the model does not fail.
class ModelFailures {
 public:
  /// Adds the exception that is being handled: to be called in a catch clause. One for each object; the last counts.
  void add_current(ObjectId object) noexcept;
  void add(const ModelFailure& failure);
  void add(std::span<const ModelFailure> failures) {
    for (const ModelFailure& failure : failures) add(failure);
  }
  void clear() noexcept { failures_.clear(); }
  /// In order of number; at most max_model_failures.
  std::span<const ModelFailure> span() const noexcept { return failures_; }

 private:
  std::vector<ModelFailure> failures_;
};

}  // namespace ringfence::nodes
