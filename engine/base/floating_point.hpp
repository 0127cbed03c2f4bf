#pragma once

#include <cfenv>

namespace ringfence::base {

/// A scope in which the calling thread computes in the default floating-point environment: rounding to nearest, no
/// flush-to-zero, no denormals-are-zero, all exceptions masked.
///
/// Results depend on that environment, and an embedder may have changed it: a program that is linked with -ffast-math
/// flushes denormals from its start, and a new thread inherits what its creator had. So each of our threads opens a
/// scope when it starts, and each public call that computes opens one on the caller's thread.
///
/// The destructor restores the caller's rounding, denormal and exception modes, also when an exception leaves the
/// scope. Status flags are no part of the contract: they are raised as by any arithmetic.
///
/// Threads: construct and destroy on the same thread. Scopes may nest. Cost: a few instructions where the environment
/// is the default already. No allocation.
class DefaultFloatingPoint {
 public:
  // Not inline: the compiler may move arithmetic past an inline change of the environment.
  DefaultFloatingPoint() noexcept;
  ~DefaultFloatingPoint();
  DefaultFloatingPoint(const DefaultFloatingPoint&) = delete;
  DefaultFloatingPoint& operator=(const DefaultFloatingPoint&) = delete;

 private:
  std::fenv_t before_;  ///< set only where `changed_`
  bool changed_;
};

}  // namespace ringfence::base
