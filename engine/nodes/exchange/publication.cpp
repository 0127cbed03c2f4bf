#include "nodes/exchange/publication.hpp"

#include <cassert>
#include <numeric>

#include "geometry/vector.hpp"
#include "queries/median_splits.hpp"

namespace ringfence::nodes {

using geometry::CornerBox;

using queries::BoxTree;

namespace {

constexpr CornerBox empty_box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};

/// Reader: orders its reads of a buffer before its second test of the stamp. Writer: orders the reset of the stamp
/// before its writes to the buffer. Needed only if the frame protocol is violated. Left out under the thread sanitizer,
/// which does not support fences and would report that case as a race.
void fence() noexcept {
#if !defined(__SANITIZE_THREAD__)
  std::atomic_thread_fence(std::memory_order_acq_rel);
#endif
}

void widen(CornerBox& box, const CornerBox& by) noexcept {
  Vec3d &low = box.lower, &high = box.upper;
  low = {std::min(low.x, by.lower.x), std::min(low.y, by.lower.y), std::min(low.z, by.lower.z)};
  high = {std::max(high.x, by.upper.x), std::max(high.y, by.upper.y), std::max(high.z, by.upper.z)};
}

CornerBox box_around(std::span<const PublishedState> states) noexcept {
  Vec3d low = states[0].pose.position, high = low;
  for (const PublishedState& state : states.subspan(1)) {
    const Vec3d p = state.pose.position;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  return {low, high};
}

/// The volume of a box that is wider by `by` along each axis: the share of readers that list it. Sides have an upper
/// bound, so that the box of an object which is far away from all others does not hide what becomes of their boxes.
double widened_volume(const CornerBox& box, double by) noexcept {
  const Vec3d size = box.upper - box.lower;
  const auto side = [&](double length) { return std::min(length, 6 * by) + by; };
  return side(size.x) * side(size.y) * side(size.z);
}

/// A place in the midst of the states: boxes are most precise near it, and one object may be far from all others.
Vec3d origin_of(std::span<const PublishedState> states) noexcept {
  const std::size_t quarter = states.size() / 4;
  const auto at = [&](std::size_t i) { return states[i * quarter].pose.position; };
  return states.empty() ? Vec3d{} : queries::median(at(1), at(2), at(3));
}

/// Adds leaves of `size` states, up to `states`, to a list that ends with the begin of the first of them.
void add_leaves(base::FlatList<std::uint32_t>& begins, std::size_t states, std::size_t size) {
  for (std::size_t begin = begins.back(); begin < states;) {
    begin = std::min(begin + size, states);
    begins.push_back(static_cast<std::uint32_t>(begin));
  }
}

/// How much boxes may have grown at the end of a frame since they were sorted, in frame `sorted`.
///
/// Sorting takes as long as ten publications. Where 64,000 objects in a world of 160 m move at up to 3 m/s along each
/// axis, and readers read 25 m around, an order lasts for about 50 frames, and readers list 5 % more states than if all
/// were sorted in each frame. Where objects move so fast that an order is soon bad, it is kept for longer.
///
/// A frame waits for the slowest of several publications, so they are sorted in the same frames: only in each eighth,
/// and in each 32nd already after less growth.
double most_growth(std::uint64_t frame, std::uint64_t sorted) noexcept {
  constexpr double good_age = 16;
  const auto age = static_cast<double>(std::max<std::uint64_t>(frame - sorted, 1));
  const double good_growth = frame % 32 == 0 ? 0.1 : 0.15;
  return frame % 8 != 0 ? infinity : 1 + good_growth * std::max(1.0, good_age / age);
}

}  // namespace

Publication::Publication(std::size_t states, double interest, std::size_t kept_frames)
    : interest_(interest), kept_frames_(kept_frames) {
  assert(kept_frames == 1 || kept_frames == 2);
  entries_.reserve(states);
  numbers_.reserve(states);
  new_.reserve(states);
  // At most as many leaves as finish() keeps, those of new entries that it sorts then, and of those that it does not
  // sort.
  const std::size_t leaves = states / 4 + states / 16 + 32;
  begins_.reserve(leaves);
  begins_.push_back(0);
  for (FrameBuffer& buffer : std::span(buffers_).first(kept_frames)) {
    buffer.states.reserve(states);
    buffer.leaf_begins.reserve(leaves);
    buffer.tree.reserve(leaves);
  }
}

void Publication::begin(std::uint64_t frame) noexcept {
  current_ = frame != frame_ ? next_buffer() : current_;
  buffers_[current_].stamp.store(no_stamp, std::memory_order_relaxed);
  fence();
  frame_ = frame;
}

void Publication::list_first(std::uint32_t size) {
  const auto listed = static_cast<std::uint32_t>(entries_.size());
  for (std::uint32_t entry = listed; entry < size; ++entry) list(entry);
  if (listed <= size) {
    return;
  }
  const std::size_t kept = keep_entries([&](std::size_t i, std::size_t) { return entries_[i] < size; });
  entries_.resize(kept);
  numbers_.resize(kept);
}

/// Sorts what must be, writes the tree, then the stamp. Precondition: the states are written.
void Publication::finish() {
  FrameBuffer& buffer = buffers_[current_];
  const std::size_t size = buffer.states.size();
  const std::size_t sorted = begins_[sorted_leaves_], tail_sorted = begins_.back();
  // New entries that are many of all are sorted with the others, and else with those that came shortly before. Where
  // many objects have left, leaves are small, and the tree is larger than it has to be.
  bool all = size - sorted > size / 4 || begins_.size() > size / 4 + 16;
  if (!all && size - tail_sorted > (tail_sorted - sorted) / 8) {
    sort(buffer, sorted_leaves_, tail_leaf_size);
  }
  double cost = all ? 0 : set_boxes(buffer);
  all |= cost > most_growth(frame_, sorted_frame_) * sorted_cost_ * static_cast<double>(size);
  if (all) {
    sort(buffer, 0, leaf_size);
    sorted_leaves_ = begins_.size() - 1;
    cost = set_boxes(buffer);
    sorted_cost_ = cost / static_cast<double>(size);
    sorted_frame_ = frame_;
  }
  buffer.tree.finish();
  // Pairs with the load in find_buffer: the buffer is complete.
  buffer.stamp.store(frame_, std::memory_order_release);
}

/// Sets the leaves and the lowest boxes of the tree. Returns a number that is proportional to the number of states that
/// a reader lists.
double Publication::set_boxes(FrameBuffer& buffer) const {
  const std::span<const PublishedState> states = buffer.states.span();
  base::FlatList<std::uint32_t>& begins = buffer.leaf_begins;
  begins.resize(begins_.size());
  std::copy(begins_.begin(), begins_.end(), begins.begin());
  add_leaves(begins, states.size(), leaf_size);
  const std::size_t leaves = begins.size() - 1;
  const Vec3d origin = origin_of(states);
  queries::BoxGroup* const groups = buffer.tree.start(leaves, origin);
  buffer.bounds = empty_box;
  double cost = 0;
  for (std::size_t leaf = 0; leaf < leaves; ++leaf) {
    const std::size_t count = begins[leaf + 1] - begins[leaf];
    const CornerBox box = box_around(states.subspan(begins[leaf], count));
    queries::set_box(groups, leaf, box, origin);
    widen(buffer.bounds, box);
    cost += widened_volume(box, 2 * interest_) * static_cast<double>(count);
  }
  return cost;
}

/// Sorts the states and entries from leaf `leaf` on, and makes leaves of `size` of them.
void Publication::sort(FrameBuffer& buffer, std::size_t leaf, std::size_t size) {
  sort_states(buffer, begins_[leaf]);
  begins_.resize(leaf + 1);
  add_leaves(begins_, buffer.states.size(), size);
}

/// Sorts the states from `first` on, and their entries: follows each cycle of the permutation.
void Publication::sort_states(FrameBuffer& buffer, std::size_t first) {
  std::vector<std::uint32_t>& order = new_;  // has been read
  order.resize(buffer.states.size() - first);
  std::iota(order.begin(), order.end(), 0u);
  PublishedState* const states = buffer.states.data() + first;
  std::uint32_t* const entries = entries_.data() + first;
  ObjectNumber* const numbers = numbers_.data() + first;
  queries::thread_splits().sort({states, order.size()}, order);
  for (std::uint32_t start = 0; start < order.size(); ++start) {
    if (order[start] == start) continue;
    const PublishedState state = states[start];
    const std::uint32_t entry = entries[start];
    std::uint32_t to = start;
    for (std::uint32_t from = order[to]; from != start; from = order[to]) {
      states[to] = states[from];
      entries[to] = entries[from];
      numbers[to] = states[to].number;
      order[to] = to;
      to = from;
    }
    states[to] = state;
    entries[to] = entry;
    numbers[to] = state.number;
    order[to] = to;
  }
}

CornerBox Publication::bounds(std::uint64_t frame) const noexcept {
  const FrameBuffer* buffer = find_buffer(frame);
  return buffer ? buffer->bounds : empty_box;
}

bool Publication::is_intact(std::uint64_t frame) const noexcept {
  fence();
  return find_buffer(frame) != nullptr;
}

}  // namespace ringfence::nodes
