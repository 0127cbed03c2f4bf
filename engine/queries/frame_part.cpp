#include "queries/frame_part.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/prefetch.hpp"
#include "geometry/vector.hpp"
#include "queries/tree_space.hpp"

namespace ringfence::queries {

void FramePart::build(std::span<const FrameObject> rows, std::size_t count, std::span<const Pose> ends,
                      const geometry::ShapeTable& shapes, std::shared_ptr<const TreeOrder> hint) {
  rows_ = rows;
  ends_.assign(ends.begin(), ends.end());
  order_ = adapt(std::move(hint), rows, count);
  if (order_ != nullptr) {
    find_bounds(shapes, choose_space(rows, order_->rows, shapes.rows().data()));
    return;
  }
  if (own_ == nullptr || is_shared_) own_ = std::make_shared<TreeOrder>();
  is_shared_ = false;
  own_->rows.clear();
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    if (rows[i].number != 0) own_->rows.push_back(i);
  }
  const geometry::FixedSpace space = choose_space(rows, own_->rows, shapes.rows().data());
  sort_.sort(rows, space, own_->rows);
  order_ = own_;
  find_bounds(shapes, space);
  own_->cost = tree_.cost();
}

// Sorting takes as long as some searches that visit a fifth more boxes.
std::shared_ptr<const TreeOrder> FramePart::share_order() noexcept {
  constexpr double most = 1.2;
  if (tree_.cost() > most * order_->cost) return nullptr;
  is_shared_ = true;
  return order_;
}

void FramePart::find_bounds(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space) {
  const std::vector<std::uint32_t>& objects = order_->rows;
  bounds_.resize(objects.size());
  margins_.resize(objects.size());
  constexpr std::size_t batch = 128, ahead = 16;
  std::array<geometry::PlacedShape, batch> placed;
  for (std::size_t first = 0; first < objects.size(); first += batch) {
    const std::size_t count = std::min(batch, objects.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      base::prefetch_object(rows_[objects[std::min(first + i + ahead, objects.size() - 1)]]);
      const FrameObject& object = rows_[objects[first + i]];
      const geometry::ShapeRow& shape = shapes.row(object.shape);
      placed[i] = {&object.pose, object.shape};
      margins_[first + i] = shape.bounding_radius * tolerance_of(shape.kind);
    }
    if (ends_.empty()) shapes.bounds(std::span(placed).first(count), space, bounds_.data() + first);
  }
  // On its way a shape turns, so its box is that of its bounding ball at both ends.
  for (std::size_t i = 0; i < objects.size() && !ends_.empty(); ++i) {
    const FrameObject& object = rows_[objects[i]];
    const Vec3d &from = object.pose.position, &to = ends_[objects[i]].position;
    const double radius = double{shapes.row(object.shape).bounding_radius} * (1 + 0x1p-20);
    const Vec3d ball{radius, radius, radius};
    bounds_[i] = space.bounds(Vec3d{std::min(from.x, to.x), std::min(from.y, to.y), std::min(from.z, to.z)} - ball,
                              Vec3d{std::max(from.x, to.x), std::max(from.y, to.y), std::max(from.z, to.z)} + ball);
  }
  tree_.build(bounds_, margins_, space);
}

}  // namespace ringfence::queries
