#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "geometry/vector.hpp"
#include "narrow_phase/query/double_double.hpp"

namespace ringfence::narrow_phase {

/// Three numbers: double or DoubleDouble.
template <class T>
struct Triple {
  T x = 0.0, y = 0.0, z = 0.0;
};
template <class T>
constexpr Triple<T> operator+(const Triple<T>& p, const Triple<T>& q) noexcept {
  return {p.x + q.x, p.y + q.y, p.z + q.z};
}
template <class T>
constexpr Triple<T> operator-(const Triple<T>& p, const Triple<T>& q) noexcept {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}
template <class T>
constexpr Triple<T> operator*(const Triple<T>& p, T s) noexcept {
  return {p.x * s, p.y * s, p.z * s};
}
template <class T>
constexpr T dot(const Triple<T>& p, const Triple<T>& q) noexcept {
  return (p.x * q.x + p.y * q.y) + p.z * q.z;
}
template <class T>
constexpr Triple<T> cross(const Triple<T>& p, const Triple<T>& q) noexcept {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}
template <class T>
T length(const Triple<T>& p) noexcept {
  using std::sqrt;
  return sqrt(dot(p, p));
}

/// A point of one shape, a point of another, and their difference without rounding, as far as T can hold it.
template <class T>
struct SimplexVertex {
  Vec3d on_a, on_b;
  Triple<T> difference;  ///< on_a - on_b

  SimplexVertex() = default;
  SimplexVertex(Vec3d a, Vec3d b) noexcept
      : on_a(a), on_b(b), difference{T(a.x) - T(b.x), T(a.y) - T(b.y), T(a.z) - T(b.z)} {}
};

/// Up to four vertices of the difference of two shapes, and the point of their hull that is nearest to the origin.
///
/// The nearest point is always a weighted mean of the vertices with positive weights, so it is a point of the
/// difference even if rounding has made the weights wrong. T is double, or DoubleDouble where that is not precise
/// enough. Method: the faces that contain the newest vertex are tried one by one (Johnson's subalgorithm without its
/// recursion; Gilbert, Johnson and Keerthi 1988), and the nearest projection counts, so flat faces do no harm.
template <class T>
class Simplex {
 public:
  explicit Simplex(const SimplexVertex<T>& vertex) noexcept { restart(vertex); }
  /// The simplex of the same vertices in another precision.
  template <class Other>
  explicit Simplex(const Simplex<Other>& other) noexcept;

  std::size_t size() const noexcept { return size_; }
  const SimplexVertex<T>& vertex(std::size_t i) const noexcept { return vertices_[i]; }
  bool has(const SimplexVertex<T>& vertex) const noexcept;

  /// Adds a vertex and reduces the simplex to the face with the nearest point. Returns false, without a change, if no
  /// face with the new vertex comes nearer to the origin. Precondition: fewer than four vertices.
  bool add(const SimplexVertex<T>& vertex) noexcept;

  const Triple<T>& nearest() const noexcept { return nearest_; }
  T squared_distance() const noexcept { return squared_; }  ///< of the nearest point
  /// The unit vector from the origin to the nearest point, as precise as the vertices allow. Precondition: they differ.
  Vec3d direction() const noexcept;
  /// The points of the two shapes whose difference is the nearest point.
  Vec3d nearest_on_a() const noexcept { return mean(&SimplexVertex<T>::on_a); }
  Vec3d nearest_on_b() const noexcept { return mean(&SimplexVertex<T>::on_b); }

 private:
  template <class Other>
  friend class Simplex;
  using Chosen = std::array<std::size_t, 4>;

  void restart(const SimplexVertex<T>& vertex) noexcept;
  /// Makes `best` the face of the chosen vertices if that is nearer.
  void try_face(const Chosen& chosen, std::size_t count, Simplex& best) const noexcept;
  bool project(const Chosen& chosen, std::size_t count, std::array<T, 4>& weights) const noexcept;
  Vec3d mean(Vec3d SimplexVertex<T>::*point) const noexcept;

  std::array<SimplexVertex<T>, 4> vertices_;
  std::array<T, 4> weights_;
  Triple<T> nearest_;
  T squared_ = 0.0;
  std::size_t size_ = 0;
};

template <>
Vec3d Simplex<double>::direction() const noexcept;
template <>
Vec3d Simplex<DoubleDouble>::direction() const noexcept;
extern template class Simplex<double>;
extern template class Simplex<DoubleDouble>;

}  // namespace ringfence::narrow_phase
