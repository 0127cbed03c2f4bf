#include "queries/frame_part.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>
#include <vector>

#include "geometry/vector.hpp"
#include "queries/median_splits.hpp"

namespace ringfence::queries {
namespace {

/// What builds of all parts need for a while.
struct Scratch {
  base::FlatList<RowBounds> bounds;   ///< in the order of the tree
  std::vector<std::uint32_t> groups;  ///< of leaves, ascending
};

Scratch& scratch() {
  thread_local Scratch mine;
  return mine;
}

}  // namespace

void FramePart::build(const FrameRows& objects, const geometry::ShapeTable& shapes, const KnownBounds& known,
                      std::shared_ptr<const TreeOrder> hint) {
  objects_ = objects;
  if (hint != nullptr && build_in(*hint, objects, shapes, known)) {
    order_ = std::move(hint);
    return;
  }
  if (own_ == nullptr || is_shared_) own_ = std::make_shared<TreeOrder>();
  is_shared_ = false;
  const bool adapted = hint != nullptr && adapt(*hint, objects, *own_);
  build_own(adapted, objects, shapes, known);
}

void FramePart::build_again(const FrameRows& objects, const geometry::ShapeTable& shapes, const KnownBounds& known) {
  if (own_ == nullptr || is_shared_ || !is_good()) return build(objects, shapes, known, nullptr);
  objects_ = objects;
  if (build_in(*own_, objects, shapes, known)) return;
  if (spare_ == nullptr) spare_ = std::make_shared<TreeOrder>();
  const bool adapted = adapt(*own_, objects, *spare_);
  own_.swap(spare_);
  build_own(adapted, objects, shapes, known);
}

/// Builds the tree in an order if exactly its keys have objects.
bool FramePart::build_in(const TreeOrder& order, const FrameRows& objects, const geometry::ShapeTable& shapes,
                         const KnownBounds& known) {
  if (order.keys.size() != objects.objects) return false;
  const bool is_same = std::exchange(is_built_, false) && &order == order_.get() && known.built.has_value();
  std::vector<std::uint32_t>& groups = scratch().groups;
  if (is_same && known.same_rows) {
    find_changed_groups(known, groups);
  } else if (is_same ? !find_changed_rows(order, objects, known, groups) : !find_rows(order, objects)) {
    return false;
  }
  if (known.rows.empty()) {
    set_bounds(shapes);
  } else if (is_same) {
    tree_.update(known.rows, row_of_box_.span(), *known.box_of, groups);
  } else {
    tree_.build(known.rows, row_of_box_.span(), *known.box_of);
  }
  is_built_ = true;
  return true;
}

/// False if a key has no object.
bool FramePart::find_rows(const TreeOrder& order, const FrameRows& objects) {
  row_of_box_.resize(order.keys.size());
  for (std::size_t i = 0; i < order.keys.size(); ++i) {
    const std::uint32_t row = objects.row(order.keys[i]);
    if (row == FrameRows::none) return false;
    row_of_box_[i] = row;
  }
  return true;
}

/// The same for the order of the tree as it is; sets `groups` to those of its leaves that have changed.
bool FramePart::find_changed_rows(const TreeOrder& order, const FrameRows& objects, const KnownBounds& known,
                                  std::vector<std::uint32_t>& groups) {
  groups.clear();
  for (std::size_t first = 0; first < order.keys.size(); first += tree_width) {
    bool any = false;
    for (std::size_t i = first; i < std::min(first + tree_width, order.keys.size()); ++i) {
      const std::uint32_t row = objects.row(order.keys[i]);
      if (row == FrameRows::none) return false;
      any |= base::may_have_changed(known.changed[row], *known.built);
      row_of_box_[i] = row;
    }
    if (any) groups.push_back(static_cast<std::uint32_t>(first / tree_width));
  }
  return true;
}

/// The same if each key has the row that it had before. Where most objects have changed, all groups, because the rows
/// of a group are anywhere in the list.
void FramePart::find_changed_groups(const KnownBounds& known, std::vector<std::uint32_t>& groups) const {
  const auto has_changed = [&](std::uint32_t row) { return base::may_have_changed(known.changed[row], *known.built); };
  std::uint32_t count = 0;
  for (std::uint32_t row = 0; row < known.changed.size(); ++row) count += has_changed(row) ? 1 : 0;
  const std::span<const std::uint32_t> rows = row_of_box_.span();
  groups.clear();
  if (count > rows.size() / 2) {
    groups.resize((rows.size() + tree_width - 1) / tree_width);
    std::iota(groups.begin(), groups.end(), 0u);
    return;
  }
  for (std::size_t first = 0; count != 0 && first < rows.size(); first += tree_width) {
    const std::span<const std::uint32_t> group = rows.subspan(first, std::min(tree_width, rows.size() - first));
    if (std::any_of(group.begin(), group.end(), has_changed)) {
      groups.push_back(static_cast<std::uint32_t>(first / tree_width));
    }
  }
}

/// Builds the tree in the order own_, which is sorted first unless it has been adapted.
void FramePart::build_own(bool adapted, const FrameRows& objects, const geometry::ShapeTable& shapes,
                          const KnownBounds& known) {
  is_built_ = false;
  order_ = own_;
  if (!adapted) sort(objects);
  (void)build_in(*own_, objects, shapes, known);  // each of its keys has an object
  if (!adapted) own_->cost = tree_.cost();
}

void FramePart::sort(const FrameRows& objects) {
  own_->keys.clear();
  for (std::uint32_t key = 0; key < objects.row_of.size(); ++key) {
    if (objects.row_of[key] != FrameRows::none) own_->keys.push_back(key);
  }
  thread_splits().sort(objects, own_->keys);
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

/// Builds the tree with the bounds of all objects, which are not known.
void FramePart::set_bounds(const geometry::ShapeTable& shapes) {
  const Vec3d origin = choose_origin(objects_.rows, row_of_box_.span());
  const geometry::FixedSpace space = space_around(origin, objects_.rows, row_of_box_.span());
  base::FlatList<RowBounds>& bounds = scratch().bounds;
  bounds.resize(row_of_box_.size());
  find_bounds(shapes, space, bounds.data());
  tree_.build(bounds.span(), BoxConverter(space, origin));
}

void FramePart::find_bounds(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space,
                            RowBounds* out) const {
  constexpr std::size_t batch = 128, ahead = 16;
  const std::size_t size = row_of_box_.size();
  std::array<geometry::PlacedShape, batch> placed;
  std::array<geometry::Bounds, batch> bounds;
  for (std::size_t first = 0; first < size; first += batch) {
    const std::size_t count = std::min(batch, size - first);
    for (std::size_t i = 0; i < count; ++i) {
      base::prefetch_object(objects_.rows[row_of_box_[std::min(first + i + ahead, size - 1)]]);
      const FrameObject& object = objects_.rows[row_of_box_[first + i]];
      placed[i] = {&object.pose, object.shape};
    }
    shapes.bounds(std::span(placed).first(count), space, bounds.data());
    for (std::size_t i = 0; i < count; ++i) {
      out[first + i] = {bounds[i], margin_of(shapes.row(placed[i].shape))};
    }
  }
}

}  // namespace ringfence::queries
