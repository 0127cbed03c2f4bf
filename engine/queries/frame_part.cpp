#include "queries/frame_part.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/prefetch.hpp"
#include "geometry/vector.hpp"
#include "queries/median_splits.hpp"

namespace ringfence::queries {
namespace {

/// What builds of all parts need for a while.
struct Scratch {
  base::FlatList<RowBounds> bounds;  ///< in the order of the tree
  MedianSplits splits;
};

Scratch& scratch() {
  thread_local Scratch mine;
  return mine;
}

}  // namespace

void FramePart::build(std::span<const FrameObject> rows, std::size_t count, std::span<const Pose> ends,
                      const geometry::ShapeTable& shapes, const KnownBounds& known,
                      std::shared_ptr<const TreeOrder> hint) {
  rows_ = rows;
  ends_.assign(ends.begin(), ends.end());
  const KnownBounds usable = ends_.empty() ? known : KnownBounds{};
  if (hint != nullptr && build_in(*hint, count, usable)) {
    order_ = std::move(hint);
    return;
  }
  if (hint != nullptr && usable.rows.empty() && has_same_rows(*hint, rows, count)) {
    order_ = std::move(hint);
    find_bounds(shapes);
    return;
  }
  if (own_ == nullptr || is_shared_) own_ = std::make_shared<TreeOrder>();
  is_shared_ = false;
  const bool adapted = hint != nullptr && adapt(*hint, rows, count, *own_);
  finish(adapted, shapes, usable);
}

void FramePart::build_again(std::span<const FrameObject> rows, std::size_t count, const geometry::ShapeTable& shapes,
                            const KnownBounds& known) {
  if (own_ == nullptr || is_shared_ || !is_good()) return build(rows, count, {}, shapes, known, nullptr);
  rows_ = rows;
  if (build_in(*own_, count, known)) return;
  if (spare_ == nullptr) spare_ = std::make_shared<TreeOrder>();
  const bool adapted = adapt(*own_, rows, count, *spare_);
  own_.swap(spare_);
  finish(adapted, shapes, known);
}

/// Builds the tree in an order if exactly its rows have objects, and their bounds are known, which say so.
bool FramePart::build_in(const TreeOrder& order, std::size_t count, const KnownBounds& known) {
  return !known.rows.empty() && order.rows.size() == count && order.end <= rows_.size() &&
         tree_.build(known.rows, order.rows, *known.box_of);
}

/// Builds the tree in the order of own_, which is sorted first unless it has been adapted.
void FramePart::finish(bool adapted, const geometry::ShapeTable& shapes, const KnownBounds& known) {
  order_ = own_;
  if (!adapted) sort();
  if (known.rows.empty()) {
    find_bounds(shapes);
  } else {
    tree_.build(known.rows, order_->rows, *known.box_of);
  }
  if (!adapted) own_->cost = tree_.cost();
}

void FramePart::sort() {
  own_->rows.clear();
  for (std::uint32_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i].number != 0) own_->rows.push_back(i);
  }
  own_->end = static_cast<std::uint32_t>(rows_.size());
  scratch().splits.sort(rows_, own_->rows);
}

// Sorting takes twice as long as an index. Where objects move at 10 m/s in a world of 160 m, an order lasts for eleven
// frames with this bound.
bool FramePart::is_good() const noexcept {
  constexpr double most = 1.5;
  return tree_.cost() <= most * order_->cost;
}

std::shared_ptr<const TreeOrder> FramePart::share_order() noexcept {
  if (!is_good()) return nullptr;
  is_shared_ = true;
  return order_;
}

void FramePart::find_bounds(const geometry::ShapeTable& shapes) {
  const std::vector<std::uint32_t>& objects = order_->rows;
  const Vec3d origin = choose_origin(rows_, objects);
  const geometry::FixedSpace space = space_around(origin, rows_, objects);
  base::FlatList<RowBounds>& bounds = scratch().bounds;
  bounds.resize(objects.size());
  if (ends_.empty()) {
    find_standing(shapes, space, bounds.data());
  } else {
    find_ways(shapes, space, bounds.data());
  }
  tree_.build(bounds.span(), BoxConverter(space, origin));
}

void FramePart::find_standing(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, RowBounds* out) {
  const std::vector<std::uint32_t>& objects = order_->rows;
  constexpr std::size_t batch = 128, ahead = 16;
  std::array<geometry::PlacedShape, batch> placed;
  std::array<geometry::Bounds, batch> bounds;
  for (std::size_t first = 0; first < objects.size(); first += batch) {
    const std::size_t count = std::min(batch, objects.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      base::prefetch_object(rows_[objects[std::min(first + i + ahead, objects.size() - 1)]]);
      const FrameObject& object = rows_[objects[first + i]];
      placed[i] = {&object.pose, object.shape};
    }
    shapes.bounds(std::span(placed).first(count), space, bounds.data());
    for (std::size_t i = 0; i < count; ++i) {
      out[first + i] = {bounds[i], margin_of(shapes.row(placed[i].shape))};
    }
  }
}

// On its way a shape turns, so its box is that of its bounding ball at both ends.
void FramePart::find_ways(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, RowBounds* out) {
  for (std::size_t i = 0; i < order_->rows.size(); ++i) {
    const std::uint32_t row = order_->rows[i];
    const Vec3d &from = rows_[row].pose.position, &to = ends_[row].position;
    const geometry::ShapeRow& shape = shapes.row(rows_[row].shape);
    const double radius = double{shape.bounding_radius} * (1 + 0x1p-20);
    const Vec3d ball{radius, radius, radius};
    out[i] = {space.bounds(Vec3d{std::min(from.x, to.x), std::min(from.y, to.y), std::min(from.z, to.z)} - ball,
                           Vec3d{std::max(from.x, to.x), std::max(from.y, to.y), std::max(from.z, to.z)} + ball),
              margin_of(shape)};
  }
}

}  // namespace ringfence::queries
