#include "queries/swept_frames.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/flat_list.hpp"
#include "queries/median_splits.hpp"
#include "queries/tree_box.hpp"

namespace ringfence::queries {
namespace {

/// What all builds of a thread need for a while.
struct SweptScratch {
  std::vector<std::uint32_t> order;
  // In the order of the keys.
  base::FlatList<Stay> stays;
  base::FlatList<RowBounds> bounds;
  MedianSplits splits;
};

SweptScratch& swept_scratch() {
  thread_local SweptScratch mine;
  return mine;
}

/// Whether an object that has not jumped comes from a frame, and has not changed its shape.
bool continues(const FrameObject& before, const FrameObject& now) noexcept {
  return now.number == before.number && now.generation == before.generation && now.shape == before.shape;
}

constexpr geometry::Bounds no_bounds() noexcept {
  constexpr std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  return {{last, last, last}, {0, 0, 0}};
}

/// Computes the bounds of shapes, many at a time, and adds each to the bounds of its stay.
class BoundsAdder {
 public:
  BoundsAdder(const geometry::ShapeTable& shapes, const geometry::FixedSpace& space, base::FlatList<RowBounds>& out)
      : shapes_(shapes), space_(space), out_(out) {}

  void add(std::size_t stay, const FrameObject& object) {
    if (size_ == batch) finish();
    placed_[size_] = {&object.pose, object.shape};
    stays_[size_++] = stay;
  }
  void finish() {
    shapes_.bounds(std::span(placed_).first(size_), space_, bounds_.data());
    for (std::size_t i = 0; i < size_; ++i) {
      geometry::Bounds& sum = out_[stays_[i]].bounds;
      for (std::size_t a = 0; a < 3; ++a) {
        sum.lower[a] = std::min(sum.lower[a], bounds_[i].lower[a]);
        sum.upper[a] = std::max(sum.upper[a], bounds_[i].upper[a]);
      }
    }
    size_ = 0;
  }

 private:
  static constexpr std::size_t batch = 128;
  const geometry::ShapeTable& shapes_;
  const geometry::FixedSpace& space_;
  base::FlatList<RowBounds>& out_;
  std::size_t size_ = 0;
  std::array<geometry::PlacedShape, batch> placed_;
  std::array<std::size_t, batch> stays_;
  std::array<geometry::Bounds, batch> bounds_;
};

/// Finds the stays of all objects, and their bounds.
class StayFinder {
 public:
  StayFinder(std::span<const FrameRows> frames, const geometry::ShapeTable& shapes, const geometry::FixedSpace& space,
             SweptScratch& out)
      : frames_(frames), shapes_(shapes), out_(out), adder_(shapes, space, out.bounds) {}

  void find() {
    std::size_t keys = 0;
    for (const FrameRows& frame : frames_) keys = std::max(keys, frame.row_of.size());
    out_.stays.clear();
    out_.bounds.clear();
    for (std::uint32_t key = 0; key < keys; ++key) visit(key);
    adder_.finish();
  }

 private:
  void visit(std::uint32_t key) {
    const FrameObject* before = nullptr;  // null: no stay has begun
    for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
      const std::uint32_t row = frames_[frame].row(key);
      const FrameObject* const now = row == FrameRows::none ? nullptr : &frames_[frame].rows[row];
      if (before != nullptr && now != nullptr && !frames_[frame].has_jumped(row) && continues(*before, *now)) {
        go_on(row, *before, *now);
        before = now;
        continue;
      }
      if (before != nullptr) finish(*before);
      before = frame + 1 < frames_.size() ? now : nullptr;
      if (before != nullptr) begin(key, row, frame, *now);
    }
    if (before != nullptr) finish(*before);
  }

  void begin(std::uint32_t key, std::uint32_t row, std::size_t frame, const FrameObject& now) {
    const auto number = static_cast<std::uint8_t>(frame);
    out_.stays.push_back({key, row, number, number});
    out_.bounds.push_back({no_bounds(), 0});
    adder_.add(out_.stays.size() - 1, now);
    least_cosine_ = 1;
  }
  void go_on(std::uint32_t row, const FrameObject& before, const FrameObject& now) {
    Stay& stay = out_.stays.back();
    ++stay.last;
    if (row != stay.row) stay.row = FrameRows::none;
    if (before.pose == now.pose) return;
    adder_.add(out_.stays.size() - 1, now);
    least_cosine_ = std::min(least_cosine_, turn_cosine(before.pose.orientation, now.pose.orientation));
  }
  // On a way the shape turns, so its points leave the box around the bounds at both ends.
  void finish(const FrameObject& object) {
    const geometry::ShapeRow& shape = shapes_.row(object.shape);
    constexpr double rounding = 0x1p-18;  // of orientations, which are floats
    const double beyond = double{shape.bounding_radius} * (most_bulge(least_cosine_) + rounding);
    out_.bounds.back().margin = margin_of(shape) + static_cast<float>(beyond * (1 + 0x1p-20));
  }

  std::span<const FrameRows> frames_;
  const geometry::ShapeTable& shapes_;
  SweptScratch& out_;
  BoundsAdder adder_;
  double least_cosine_ = 1;  ///< of the turns in the last stay
};

}  // namespace

void SweptFrames::build(std::uint64_t first, std::span<const FrameRows> frames, const geometry::ShapeTable& shapes) {
  first_ = first;
  covered_ = frames.size() - 1;
  std::copy(frames.begin(), frames.end(), frames_.begin());

  SweptScratch& made = swept_scratch();
  made.order.clear();
  for (const std::uint32_t row : frames[0].row_of) {
    if (row != FrameRows::none) made.order.push_back(row);
  }
  const Vec3d origin = choose_origin(frames[0].rows, made.order);
  const geometry::FixedSpace space = space_around(origin, frames[0].rows, made.order);
  StayFinder(frames, shapes, space, made).find();

  made.order.resize(made.stays.size());
  std::iota(made.order.begin(), made.order.end(), std::uint32_t{0});
  made.splits.sort(made.bounds.span(), made.order);
  tree_.build(made.bounds.span(), made.order, BoxConverter(space, origin));
  stays_.clear();
  stays_.reserve(made.order.size());
  for (const std::uint32_t stay : made.order) stays_.push_back(made.stays[stay]);
}

}  // namespace ringfence::queries
