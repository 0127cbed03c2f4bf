#include "narrow_phase/query/simplex.hpp"

#include <algorithm>

namespace ringfence::narrow_phase {
namespace {

constexpr double to_double(double value) noexcept { return value; }
constexpr double to_double(DoubleDouble value) noexcept { return value.high; }

template <class T>
Vec3d to_double(const Triple<T>& p) noexcept {
  return {to_double(p.x), to_double(p.y), to_double(p.z)};
}

}  // namespace

template <class T>
template <class Other>
Simplex<T>::Simplex(const Simplex<Other>& other) noexcept {
  restart({other.vertices_[0].on_a, other.vertices_[0].on_b});
  // A vertex that brings nothing in this precision is left out.
  for (std::size_t i = 1; i < other.size_ && size_ < 4; ++i) add({other.vertices_[i].on_a, other.vertices_[i].on_b});
}

template <class T>
void Simplex<T>::restart(const SimplexVertex<T>& vertex) noexcept {
  vertices_[0] = vertex;
  weights_[0] = 1.0;
  nearest_ = vertex.difference;
  squared_ = dot(nearest_, nearest_);
  size_ = 1;
}

template <class T>
bool Simplex<T>::has(const SimplexVertex<T>& vertex) const noexcept {
  return std::any_of(vertices_.begin(), vertices_.begin() + static_cast<std::ptrdiff_t>(size_),
                     [&](const auto& known) { return known.on_a == vertex.on_a && known.on_b == vertex.on_b; });
}

template <class T>
bool Simplex<T>::project(const Chosen& chosen, std::size_t count, std::array<T, 4>& weights) const noexcept {
  const T one = 1.0, zero = 0.0;
  const Triple<T>& base = vertices_[chosen[0]].difference;
  const auto edge = [&](std::size_t i) { return vertices_[chosen[i]].difference - base; };
  const Triple<T> to_origin = base * T(-1.0);
  if (count == 2) {
    const Triple<T> e = edge(1);
    const T squared = dot(e, e);
    if (!(squared > zero)) return false;
    weights[1] = dot(to_origin, e) / squared;
    weights[0] = one - weights[1];
  } else if (count == 3) {
    const Triple<T> e = edge(1), f = edge(2), normal = cross(e, f);
    const T squared = dot(normal, normal);
    if (!(squared > zero)) return false;
    weights[1] = dot(cross(to_origin, f), normal) / squared;
    weights[2] = dot(cross(e, to_origin), normal) / squared;
    weights[0] = one - weights[1] - weights[2];
  } else {
    const Triple<T> e = edge(1), f = edge(2), g = edge(3), across = cross(f, g);
    const T volume = dot(e, across);
    if (!(volume > zero || volume < zero)) return false;
    weights[1] = dot(to_origin, across) / volume;
    weights[2] = dot(to_origin, cross(g, e)) / volume;
    weights[3] = dot(to_origin, cross(e, f)) / volume;
    weights[0] = one - weights[1] - weights[2] - weights[3];
  }
  return std::all_of(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(count),
                     [&](const T& weight) { return weight > zero; });
}

template <class T>
void Simplex<T>::try_face(const Chosen& chosen, std::size_t count, Simplex& best) const noexcept {
  std::array<T, 4> weights;
  if (!project(chosen, count, weights)) return;
  // Relative to the newest vertex: the errors of the weights then do not shift the point along that vertex.
  const Triple<T>& base = vertices_[chosen[0]].difference;
  Triple<T> point = base;
  for (std::size_t i = 1; i < count; ++i) point = point + (vertices_[chosen[i]].difference - base) * weights[i];
  const T squared = dot(point, point);
  if (!(squared < best.squared_)) return;
  best.size_ = count;
  for (std::size_t i = 0; i < count; ++i) best.vertices_[i] = vertices_[chosen[i]];
  best.weights_ = weights;
  best.nearest_ = point;
  best.squared_ = squared;
}

template <class T>
bool Simplex<T>::add(const SimplexVertex<T>& vertex) noexcept {
  vertices_[size_] = vertex;
  const std::size_t newest = size_;
  Simplex best(vertex);
  for (std::size_t i = 0; i < newest; ++i) {
    try_face({newest, i}, 2, best);
    for (std::size_t j = i + 1; j < newest; ++j) try_face({newest, i, j}, 3, best);
  }
  if (newest == 3) try_face({3, 0, 1, 2}, 4, best);
  if (!(best.squared_ < squared_)) return false;
  *this = best;
  return true;
}

template <class T>
Vec3d Simplex<T>::mean(Vec3d SimplexVertex<T>::*point) const noexcept {
  const Vec3d base = vertices_[0].*point;
  Vec3d out = base;
  for (std::size_t i = 1; i < size_; ++i) out = out + (vertices_[i].*point - base) * to_double(weights_[i]);
  return out;
}

template <>
Vec3d Simplex<DoubleDouble>::direction() const noexcept {
  const DoubleDouble scale = DoubleDouble(1.0) / sqrt(squared_);
  const Vec3d unit = to_double(nearest_ * scale);
  return unit * (1 / ringfence::length(unit));
}

template <>
Vec3d Simplex<double>::direction() const noexcept {
  const auto unit = [](const Triple<double>& p) { return to_double(p * (1 / length(p))); };
  if (size_ == 2) {
    // Where the nearest point is close to the origin, rounding tilts it along the edge: it is made perpendicular again.
    const Triple<double> e = vertices_[1].difference - vertices_[0].difference;
    Triple<double> across = nearest_ * (1 / std::sqrt(squared_));
    across = across - e * (dot(across, e) / dot(e, e));
    return unit(across);
  }
  if (size_ == 3) {
    // The normal of the triangle, unless the triangle is so thin that the nearest point is more precise.
    const Triple<double>& base = vertices_[0].difference;
    const Triple<double> e = vertices_[1].difference - base, f = vertices_[2].difference - base, normal = cross(e, f);
    const double height = dot(normal, base);
    const double error_of_normal = length(e) * length(f) * std::sqrt(squared_), error_of_point = length(base);
    if (error_of_normal < error_of_point * length(normal) && height != 0) {
      return unit(normal * (height > 0 ? 1.0 : -1.0));
    }
  }
  return unit(nearest_);
}

template class Simplex<double>;
template class Simplex<DoubleDouble>;
template Simplex<DoubleDouble>::Simplex(const Simplex<double>&) noexcept;

}  // namespace ringfence::narrow_phase
