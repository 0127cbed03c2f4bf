#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/numbers.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::geometry {

/// What CheckedSupport throws. Each frame catches it where it tests a pair or bounds an object, so it never leaves one.
struct SupportFailure {};

/// The support function of a registered shape, which is the embedder's code, with each of its points checked.
///
/// A call fails where the function throws, or where its point is not finite or lies farther from the shape's origin
/// than twice the bounding radius: the search for the least depth would not end with such points. A failure is a
/// SupportFailure, whatever the function threw; the reason of the first is kept for the log.
///
/// Threads: any, concurrently. Allocates nothing but what an exception does.
class CheckedSupport final : public SupportFunction {
 public:
  CheckedSupport(std::shared_ptr<const SupportFunction> function, ShapeNumber shape, float bounding_radius)
      : function_(std::move(function)), shape_(shape), farthest_(2 * bounding_radius) {}

  /// Throws SupportFailure.
  Vec3f support(Vec3f direction) const override;
  Vec3f centre() const override;

  /// "shape 3: support(): REASON" of the first call that failed: once, then empty again. From one thread at a time.
  std::optional<std::string> take_first_failure() const;

 private:
  template <class Call>
  Vec3f checked(const char* name, const Call& call) const;
  void note(const char* name, const char* reason) const noexcept;

  enum class Failure : std::uint8_t { none, being_noted, noted, taken };

  std::shared_ptr<const SupportFunction> function_;
  ShapeNumber shape_;
  float farthest_;
  mutable std::atomic<Failure> failure_{Failure::none};
  mutable char reason_[160] = {};  ///< written by the one thread that set `being_noted`
};

}  // namespace ringfence::geometry
