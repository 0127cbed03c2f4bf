#include "geometry/checked_support.hpp"

#include <cmath>
#include <cstdio>
#include <exception>

namespace ringfence::geometry {

Vec3f CheckedSupport::support(Vec3f direction) const {
  return checked("support", [&] { return function_->support(direction); });
}

Vec3f CheckedSupport::centre() const {
  return checked("centre", [&] { return function_->centre(); });
}

template <class Call>
Vec3f CheckedSupport::checked(const char* name, const Call& call) const {
  Vec3f point;
  try {
    point = call();
  } catch (const std::exception& error) {
    note(name, error.what());
    throw SupportFailure();
  } catch (...) {
    note(name, "an exception that is no std::exception");
    throw SupportFailure();
  }
  // Not a number is within nothing.
  if (!(std::abs(point.x) <= farthest_ && std::abs(point.y) <= farthest_ && std::abs(point.z) <= farthest_)) {
    note(name, "a point that is not finite, or outside the shape as it was registered");
    throw SupportFailure();
  }
  return point;
}

void CheckedSupport::note(const char* name, const char* reason) const noexcept {
  Failure none = Failure::none;
  if (failure_.compare_exchange_strong(none, Failure::being_noted, std::memory_order_relaxed)) {
    std::snprintf(reason_, sizeof reason_, "shape %u: %s(): %s", static_cast<unsigned>(shape_), name, reason);
    // Pairs with the acquire load in take_first_failure: the reason is written before it is read.
    failure_.store(Failure::noted, std::memory_order_release);
  }
}

std::optional<std::string> CheckedSupport::take_first_failure() const {
  if (failure_.load(std::memory_order_acquire) != Failure::noted) return std::nullopt;
  failure_.store(Failure::taken, std::memory_order_relaxed);
  return std::string(reason_);
}

}  // namespace ringfence::geometry
