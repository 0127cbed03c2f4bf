#pragma once

#include <cmath>

namespace ringfence::narrow_phase {

/// A number of about 106 bits: the sum of two doubles, of which the second is at most half a unit in the last place of
/// the first. Only with basic operations, each precise to a few units in the last of those bits (Dekker 1971; Joldes,
/// Muller and Popescu 2017). The same bits on every machine: nothing is fused.
///
/// Range: products and quotients need magnitudes between about 10^-140 and 10^140.
struct DoubleDouble {
  double high = 0, low = 0;

  constexpr DoubleDouble() = default;
  constexpr DoubleDouble(double value) noexcept : high(value) {}  // NOLINT: numbers convert
  constexpr DoubleDouble(double h, double l) noexcept : high(h), low(l) {}
  constexpr explicit operator double() const noexcept { return high; }
  constexpr DoubleDouble operator-() const noexcept { return {-high, -low}; }
};

namespace exact {

/// The sum of two doubles without rounding (Knuth).
constexpr DoubleDouble sum(double a, double b) noexcept {
  const double s = a + b, from_b = s - a;
  return {s, (a - (s - from_b)) + (b - from_b)};
}

/// The same if the magnitude of `a` is at least that of `b` (Dekker).
constexpr DoubleDouble ordered_sum(double a, double b) noexcept {
  const double s = a + b;
  return {s, b - (s - a)};
}

/// The product of two doubles without rounding (Dekker, Veltkamp).
constexpr DoubleDouble product(double a, double b) noexcept {
  constexpr double splitter = 134217729;  // 2^27 + 1
  const double p = a * b, ca = splitter * a, cb = splitter * b;
  const double a1 = ca - (ca - a), a2 = a - a1, b1 = cb - (cb - b), b2 = b - b1;
  return {p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2};
}

}  // namespace exact

constexpr DoubleDouble operator+(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble s = exact::sum(a.high, b.high), t = exact::sum(a.low, b.low);
  const DoubleDouble u = exact::ordered_sum(s.high, s.low + t.high);
  return exact::ordered_sum(u.high, t.low + u.low);
}
constexpr DoubleDouble operator-(DoubleDouble a, DoubleDouble b) noexcept { return a + -b; }
constexpr DoubleDouble operator*(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble p = exact::product(a.high, b.high);
  return exact::ordered_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}
constexpr DoubleDouble operator/(DoubleDouble a, DoubleDouble b) noexcept {
  const double first = a.high / b.high;
  const DoubleDouble rest = a - b * DoubleDouble(first);
  const double second = rest.high / b.high;
  const DoubleDouble last = rest - b * DoubleDouble(second);
  return exact::ordered_sum(first, second) + DoubleDouble(last.high / b.high);
}
constexpr bool operator<(DoubleDouble a, DoubleDouble b) noexcept {
  return a.high < b.high || (a.high == b.high && a.low < b.low);
}
constexpr bool operator>(DoubleDouble a, DoubleDouble b) noexcept { return b < a; }

/// The square root. Precondition: a is not negative.
inline DoubleDouble sqrt(DoubleDouble a) noexcept {
  if (!(a.high > 0)) return 0.0;
  const double root = std::sqrt(a.high);
  const DoubleDouble rest = a - exact::product(root, root);
  return exact::ordered_sum(root, rest.high / (2 * root));
}

}  // namespace ringfence::narrow_phase
