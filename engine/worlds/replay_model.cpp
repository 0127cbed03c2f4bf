#include "worlds/replay_model.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <tuple>
#include <utility>

#include "base/prefetch.hpp"
#include "ringfence/error.hpp"

namespace ringfence::worlds {

namespace {

/// Divides a coordinate axis into 2^bits rows between the extreme first positions.
class AxisRows {
 public:
  explicit AxisRows(unsigned bits) noexcept : rows_(static_cast<double>(std::uint64_t{1} << bits)) {}
  void include(double coordinate) noexcept {
    low_ = std::min(low_, coordinate);
    high_ = std::max(high_, coordinate);
  }
  std::uint32_t row(double coordinate) const noexcept {
    const double extent = high_ - low_;
    return extent > 0 ? static_cast<std::uint32_t>(std::min((coordinate - low_) / extent * rows_, rows_ - 1)) : 0;
  }

 private:
  double rows_;
  double low_ = std::numeric_limits<double>::max();
  double high_ = std::numeric_limits<double>::lowest();
};

struct FirstPlace {
  ObjectNumber object;
  Vec3d position;
};

// Objects that are never present come first.
std::vector<FirstPlace> first_places(const Motion& motion, base::NumberIndex& known) {
  std::vector<FirstPlace> places;
  std::vector<bool> placed;
  for (const MotionRow& row : motion.rows) {
    std::uint32_t i = known.find(row.object);
    if (i == base::NumberIndex::none) {
      i = static_cast<std::uint32_t>(places.size());
      known.set(row.object, i);
      places.push_back({row.object, {}});
      placed.push_back(false);
    }
    if (row.present && !placed[i]) {
      places[i].position = row.pose.position;
      placed[i] = true;
    }
  }
  return places;
}

}  // namespace

ReplayModel::ReplayModel(const Motion& motion) {
  if (motion.rows.size() >= 0xffffffffu) throw Error("motion: more than 2^32 - 2 rows; expected fewer");
  for (const MotionRow& row : motion.rows) {
    if (row.frame >= std::uint32_t{1} << 30) throw Error("motion: a frame number of 2^30 or more; expected less");
  }
  const std::vector<ObjectNumber> ranked = rank_objects(motion);
  link_rows(motion);
  version_ = hash(ranked);
}

// As the server orders objects that are spawned together; see order_by_position() in engine/nodes/server/objects.
std::vector<ObjectNumber> ReplayModel::rank_objects(const Motion& motion) {
  std::vector<FirstPlace> places = first_places(motion, ranks_);
  const auto bits = static_cast<unsigned>(std::bit_width(places.size())) / 3;
  AxisRows y(bits), z(bits);
  for (const FirstPlace& place : places) y.include(place.position.y), z.include(place.position.z);
  const auto key = [&](const FirstPlace& place) {
    return std::tuple(z.row(place.position.z), y.row(place.position.y), place.position.x, place.object);
  };
  std::sort(places.begin(), places.end(), [&](const FirstPlace& p, const FirstPlace& q) { return key(p) < key(q); });
  std::vector<ObjectNumber> ranked;
  ranked.reserve(places.size());
  for (const FirstPlace& place : places) {
    ranks_.set(place.object, static_cast<std::uint32_t>(ranked.size()));
    ranked.push_back(place.object);
  }
  return ranked;
}

// From the last row to the first, so that each row can name its successor.
void ReplayModel::link_rows(const Motion& motion) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;  // frame and rank, and the position in motion.rows
  order.reserve(motion.rows.size());
  for (const MotionRow& row : motion.rows) {
    order.emplace_back(std::uint64_t{row.frame} << 32 | ranks_.find(row.object),
                       static_cast<std::uint32_t>(order.size()));
  }
  std::sort(order.begin(), order.end());
  rows_.resize(order.size());
  starts_.assign(ranks_.size(), {static_cast<std::uint32_t>(order.size()), 0});
  for (std::size_t i = order.size(); i-- > 0;) {
    const MotionRow& from = motion.rows[order[i].second];
    Cursor& next = starts_[static_cast<std::uint32_t>(order[i].first)];
    Row& row = rows_[i];
    row.pose = from.pose;
    row.next = next.row;
    row.next_frame = next.frame & 0x3fffffffu;
    row.present = from.present ? 1 : 0;
    row.jump = from.jump ? 1 : 0;
    next = {static_cast<std::uint32_t>(i), from.frame};
  }
}

std::uint64_t ReplayModel::hash(const std::vector<ObjectNumber>& ranked) const noexcept {
  std::uint64_t hash = rows_.size();
  const auto add = [&](auto value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    hash = (hash ^ bits) * 0x100000001b3u + 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  };
  for (std::size_t rank = 0; rank < ranked.size(); ++rank) {
    add(ranked[rank]), add(starts_[rank].row), add(starts_[rank].frame);
  }
  for (const Row& row : rows_) {
    add(row.next), add(static_cast<std::uint32_t>(row.next_frame));
    add(static_cast<std::uint32_t>(row.present | row.jump << 1));
    const Vec3d& p = row.pose.position;
    const Quat& q = row.pose.orientation;
    add(p.x), add(p.y), add(p.z), add(q.x), add(q.y), add(q.z), add(q.w);
  }
  return hash;
}

std::size_t ReplayModel::state_bytes() const noexcept { return sizeof(Cursor); }

void ReplayModel::start(const ObjectSpec& spec, std::byte* state) const {
  const std::uint32_t rank = ranks_.find(spec.number);
  const Cursor none{static_cast<std::uint32_t>(rows_.size()), 0};
  const Cursor& cursor = rank == base::NumberIndex::none ? none : starts_[rank];
  std::memcpy(state, &cursor, sizeof cursor);
}

// The objects may be in another order than the rows, so the rows of the batch are prefetched.
void ReplayModel::move(std::uint64_t frame, std::span<const MotionInput> inputs,
                       std::span<MotionOutput> outputs) const {
  const auto cursor_of = [](const MotionInput& input) {
    Cursor cursor;
    std::memcpy(&cursor, input.state, sizeof cursor);
    return cursor;
  };
  for (const MotionInput& input : inputs) {
    const Cursor cursor = cursor_of(input);
    if (is_due(cursor, frame)) base::prefetch_object(rows_[cursor.row]);
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    Cursor cursor = cursor_of(inputs[i]);
    // Applies more than one row only after frames in which the server received no state from the object's host.
    while (is_due(cursor, frame)) {
      const Row& row = rows_[cursor.row];
      outputs[i].enabled = row.present != 0;
      outputs[i].jump |= row.jump != 0;
      if (row.present != 0) outputs[i].pose = row.pose;
      cursor = {row.next, row.next_frame};
    }
    std::memcpy(outputs[i].state, &cursor, sizeof cursor);
  }
}

}  // namespace ringfence::worlds
