#include "narrow_phase/query/double_double.hpp"

#include <cmath>
#include <cstdint>
#include <random>

#include <doctest/doctest.h>

namespace ringfence::narrow_phase {
namespace {

// The oracle: 128-bit floating point, of 113 bits.
#if defined(__SIZEOF_FLOAT128__)
__extension__ typedef __float128 Quad;
#else
using Quad = long double;
static_assert(sizeof(Quad) == 16);
#endif

Quad quad(DoubleDouble value) { return Quad(value.high) + Quad(value.low); }

double relative_error(DoubleDouble found, Quad exact) {
  const Quad error = (quad(found) - exact) / exact;
  return std::abs(static_cast<double>(error));
}

TEST_CASE("sums, products, quotients and roots are precise to 2^-98") {
  const std::uint64_t seed = 1;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> mantissa(1, 2), exponent(-40, 40);
  const auto number = [&] {
    const double high = std::ldexp(mantissa(random), static_cast<int>(exponent(random)));
    const double low = high * 0x1p-54 * (mantissa(random) - 1.5);
    return exact::ordered_sum(random() % 2 == 0 ? high : -high, low);
  };
  for (int i = 0; i < 100000; ++i) {
    const DoubleDouble a = number(), b = number();
    const Quad p = quad(a), q = quad(b);
    REQUIRE(relative_error(a * b, p * q) <= 0x1p-98);
    REQUIRE(relative_error(a / b, p / q) <= 0x1p-98);
    // Where high parts cancel, the result is as precise as the numbers.
    const double scale = std::abs(a.high) + std::abs(b.high);
    REQUIRE(std::abs(static_cast<double>(quad(a + b) - (p + q))) <= 0x1p-98 * scale);
    REQUIRE(std::abs(static_cast<double>(quad(a - b) - (p - q))) <= 0x1p-98 * scale);
    const DoubleDouble root = sqrt(a * a);
    REQUIRE(relative_error(root, p < 0 ? -p : p) <= 0x1p-96);
    REQUIRE((a < b) == (p < q));
  }
}

TEST_CASE("the difference of two doubles is exact") {
  const DoubleDouble difference = DoubleDouble(1e15) - DoubleDouble(1e-15);
  CHECK(quad(difference) == Quad(1e15) - Quad(1e-15));
  CHECK(double((DoubleDouble(1e15) + DoubleDouble(3e-15)) - DoubleDouble(1e15)) == 3e-15);
}

}  // namespace
}  // namespace ringfence::narrow_phase
