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

void FramePart::build(std::span<const FrameObject> rows, std::size_t count, const geometry::ShapeTable& shapes,
                      const KnownBounds& known, std::shared_ptr<const TreeOrder> hint) {
  rows_ = rows;
  if (hint != nullptr && build_in(*hint, count, known)) {
    order_ = std::move(hint);
    return;
  }
  if (hint != nullptr && known.rows.empty() && has_same_rows(*hint, rows, count)) {
    order_ = std::move(hint);
    find_bounds(shapes);
    return;
  }
  if (own_ == nullptr || is_shared_) own_ = std::make_shared<TreeOrder>();
  is_shared_ = false;
  const bool adapted = hint != nullptr && adapt(*hint, rows, count, *own_);
  finish(adapted, shapes, known);
}

void FramePart::build_again(std::span<const FrameObject> rows, std::size_t count, const geometry::ShapeTable& shapes,
                            const KnownBounds& known) {
  if (own_ == nullptr || is_shared_ || !is_good()) return build(rows, count, shapes, known, nullptr);
  rows_ = rows;
  if (build_in(*own_, count, known)) return;
  if (spare_ == nullptr) spare_ = std::make_shared<TreeOrder>();
  const bool adapted = adapt(*own_, rows, count, *spare_);
  own_.swap(spare_);
  finish(adapted, shapes, known);
}

/// Builds the tree in an order if exactly its rows have objects, and their bounds are known, which say so.
bool FramePart::build_in(const TreeOrder& order, std::size_t count, const KnownBounds& known) {
  if (known.rows.empty() || order.rows.size() != count || order.end > rows_.size()) return false;
  const bool is_built = &order == order_.get() && tree_.size() == count;
  return is_built && !known.changed.empty() ? tree_.update(known.rows, order.rows, *known.box_of, known.changed)
                                            : tree_.build(known.rows, order.rows, *known.box_of);
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
  find_bounds(shapes, space, bounds.data());
  tree_.build(bounds.span(), BoxConverter(space, origin));
}

void FramePart::find_bounds(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, RowBounds* out) {
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

}  // namespace ringfence::queries
