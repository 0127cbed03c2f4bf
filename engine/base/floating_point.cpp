#include "base/floating_point.hpp"

#if defined(__x86_64__)
#include <xmmintrin.h>
#elif defined(__aarch64__)
#include <cstdint>
#endif

namespace ringfence::base {
namespace {

#if defined(__x86_64__)

constexpr unsigned default_mxcsr = 0x1f80;
constexpr unsigned mxcsr_flags = 0x3f;
// The modes of the x87 unit: exception masks, precision and rounding. It computes long double, and the C library reads
// the rounding mode from it.
constexpr unsigned short default_x87 = 0x033f;
constexpr unsigned short x87_modes = 0x0f3f;

bool is_default() noexcept {
  unsigned short x87;
  asm volatile("fnstcw %0" : "=m"(x87));
  return (_mm_getcsr() & ~mxcsr_flags) == default_mxcsr && (x87 & x87_modes) == default_x87;
}

void set_default() noexcept {
  std::fesetenv(FE_DFL_ENV);
  _mm_setcsr(default_mxcsr);  // fesetenv() of some C libraries does not clear the modes for denormals
}

#elif defined(__aarch64__)

bool is_default() noexcept {
  std::uint64_t fpcr;
  asm volatile("mrs %0, fpcr" : "=r"(fpcr));
  return fpcr == 0;
}

void set_default() noexcept {
  std::fesetenv(FE_DFL_ENV);
  asm volatile("msr fpcr, %0" : : "r"(std::uint64_t{0}));
}

#else

bool is_default() noexcept { return false; }  // unknown, so each scope sets and restores the environment
void set_default() noexcept { std::fesetenv(FE_DFL_ENV); }

#endif

}  // namespace

DefaultFloatingPoint::DefaultFloatingPoint() noexcept : changed_(!is_default()) {
  if (changed_) {
    std::fegetenv(&before_);
    set_default();
  }
}

DefaultFloatingPoint::~DefaultFloatingPoint() {
  if (changed_) {
    std::fesetenv(&before_);
  }
}

}  // namespace ringfence::base
