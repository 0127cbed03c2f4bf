#include "reference/exact.hpp"

#include <array>
#include <cstddef>

namespace ringfence::reference {
namespace {

/// A sum of doubles without rounding. It is stored as a list of components with the smallest first (Shewchuk's
/// expansion).
class ExactSum {
 public:
  void add(double value) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double sum = value + parts_[i];
      const double shadow = sum - value;
      const double error = (value - (sum - shadow)) + (parts_[i] - shadow);
      if (error != 0) parts_[kept++] = error;
      value = sum;
    }
    if (value != 0) parts_[kept++] = value;
    size_ = kept;
  }

  void add_product(double p, double q, double r) {
    const double high = p * q;
    const double low = std::fma(p, q, -high);
    add_product(high, r);
    add_product(low, r);
  }

  /// The sign of the sum: that of the largest component, because the components do not overlap.
  int sign() const {
    const double largest = size_ == 0 ? 0 : parts_[size_ - 1];
    return (largest > 0) - (largest < 0);
  }

 private:
  void add_product(double p, double q) {
    const double high = p * q;
    add(std::fma(p, q, -high));
    add(high);
  }

  std::array<double, 100> parts_{};  // 24 products of three doubles, four components each
  std::size_t size_ = 0;
};

void add_determinant(ExactSum& sum, double sign, const Vector& p, const Vector& q, const Vector& r) {
  sum.add_product(sign * p.x, q.y, r.z);
  sum.add_product(sign * p.y, q.z, r.x);
  sum.add_product(sign * p.z, q.x, r.y);
  sum.add_product(-sign * p.x, q.z, r.y);
  sum.add_product(-sign * p.y, q.x, r.z);
  sum.add_product(-sign * p.z, q.y, r.x);
}

int exact_orientation(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
  ExactSum sum;
  add_determinant(sum, 1, b, c, d);
  add_determinant(sum, -1, a, c, d);
  add_determinant(sum, 1, a, b, d);
  add_determinant(sum, -1, a, b, c);
  return sum.sign();
}

/// p·q − r·s by Kahan's method: the rounding error of r·s is added back, so only the difference and the final sum are
/// rounded.
double difference_of_products(double p, double q, double r, double s) {
  const double product = r * s;
  const double error = std::fma(-r, s, product);
  return std::fma(p, q, -product) + error;
}

}  // namespace

int orientation(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
  const Vector p = b - a, q = c - a, r = d - a;
  const double yz = q.y * r.z, zy = q.z * r.y, zx = q.z * r.x, xz = q.x * r.z, xy = q.x * r.y, yx = q.y * r.x;
  const double determinant = p.x * (yz - zy) + p.y * (zx - xz) + p.z * (xy - yx);
  const double permanent = std::abs(p.x) * (std::abs(yz) + std::abs(zy)) +
                           std::abs(p.y) * (std::abs(zx) + std::abs(xz)) +
                           std::abs(p.z) * (std::abs(xy) + std::abs(yx));
  const double bound = 8e-16 * permanent;  // Shewchuk's bound is 7.8e-16
  if (determinant > bound) return 1;
  if (determinant < -bound) return -1;
  return exact_orientation(a, b, c, d);
}

Vector triangle_normal(const Vector& a, const Vector& b, const Vector& c) {
  const Vector p = b - a, q = c - a;
  return {difference_of_products(p.y, q.z, p.z, q.y), difference_of_products(p.z, q.x, p.x, q.z),
          difference_of_products(p.x, q.y, p.y, q.x)};
}

}  // namespace ringfence::reference
