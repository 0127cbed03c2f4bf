#pragma once

#include <cfenv>
#include <cstdint>
#include <utility>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace ringfence::test {

/// The floating-point environments from which tests call the library.
enum class Caller : std::uint8_t {
  usual,        ///< the default
  flushing,     ///< flush-to-zero and denormals-are-zero: a program linked with -ffast-math starts in these modes
  rounding_up,  ///< every result is rounded towards plus infinity
  trapping,     ///< a division by zero, an overflow or an invalid operation ends the process
};
inline constexpr Caller callers[] = {Caller::usual, Caller::flushing, Caller::rounding_up, Caller::trapping};

constexpr const char* name_of(Caller caller) noexcept {
  constexpr const char* names[] = {"usual", "flushing", "rounding up", "trapping"};
  return names[static_cast<std::size_t>(caller)];
}

/// The calling thread's rounding, denormal and exception modes, without the status flags. Only for comparison.
inline std::uint64_t floating_point_modes() noexcept {
#if defined(__x86_64__)
  unsigned short x87;
  asm volatile("fnstcw %0" : "=m"(x87));
  return (std::uint64_t{_mm_getcsr()} & ~std::uint64_t{0x3f}) << 16 | x87;
#elif defined(__aarch64__)
  std::uint64_t fpcr;
  asm volatile("mrs %0, fpcr" : "=r"(fpcr));
  return fpcr;
#else
  return static_cast<std::uint64_t>(std::fegetround());
#endif
}

/// A scope in which the calling thread has the environment of `caller`. A mode that the machine does not support keeps
/// its default. The destructor restores the environment that the thread had before.
class CallerEnvironment {
 public:
  explicit CallerEnvironment(Caller caller) noexcept {
    std::fegetenv(&before_);
    std::fesetenv(FE_DFL_ENV);
    switch (caller) {
      case Caller::usual:
        break;
      case Caller::flushing:
#if defined(__x86_64__)
        _mm_setcsr(_mm_getcsr() | 0x8040u);
#elif defined(__aarch64__)
        asm volatile("msr fpcr, %0" : : "r"(std::uint64_t{1} << 24));
#endif
        break;
      case Caller::rounding_up:
        std::fesetround(FE_UPWARD);
        break;
      case Caller::trapping:
#if defined(__x86_64__) && defined(__GLIBC__)
        feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
#endif
        break;
    }
  }
  ~CallerEnvironment() { std::fesetenv(&before_); }
  CallerEnvironment(const CallerEnvironment&) = delete;
  CallerEnvironment& operator=(const CallerEnvironment&) = delete;

 private:
  std::fenv_t before_;
};

/// Calls `call` in the environment of `caller` and returns its result. Compute the arguments of the call before, in the
/// default environment, so that they are the same for every caller.
template <class Call>
auto call_from(Caller caller, Call call) {
  const CallerEnvironment environment(caller);
  return call();
}

}  // namespace ringfence::test
