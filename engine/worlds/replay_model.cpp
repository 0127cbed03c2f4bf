#include "worlds/replay_model.hpp"

#include <algorithm>
#include <cstring>
#include <tuple>

#include "ringfence/error.hpp"

namespace ringfence::worlds {

/// State of an object: the index in rows_ of its next row to apply. Its rows end where those of another object begin.
struct ReplayModel::Cursor {
  std::uint32_t next;
  std::uint32_t reserved;
};

namespace {

std::uint64_t hash_of(const std::vector<MotionRow>& rows) noexcept {
  std::uint64_t hash = rows.size();
  const auto add = [&](auto value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    hash = (hash ^ bits) * 0x100000001b3u + 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  };
  for (const MotionRow& row : rows) {
    add(row.frame), add(row.object);
    add(static_cast<std::uint32_t>((row.present ? 1 : 0) | (row.jump ? 2 : 0)));
    const Vec3d& p = row.pose.position;
    const Quat& q = row.pose.orientation;
    add(p.x), add(p.y), add(p.z), add(q.x), add(q.y), add(q.z), add(q.w);
  }
  return hash;
}

}  // namespace

ReplayModel::ReplayModel(const Motion& motion) : rows_(motion.rows) {
  if (rows_.size() >= 0xffffffffu) throw Error("motion: more than 2^32 - 2 rows; expected fewer");
  std::sort(rows_.begin(), rows_.end(), [](const MotionRow& p, const MotionRow& q) {
    return std::tie(p.object, p.frame) < std::tie(q.object, q.frame);
  });
  for (std::size_t i = rows_.size(); i-- > 0;) first_row_by_object_[rows_[i].object] = static_cast<std::uint32_t>(i);
  version_ = hash_of(rows_);
}

std::size_t ReplayModel::state_bytes() const noexcept { return sizeof(Cursor); }

void ReplayModel::start(const ObjectSpec& spec, std::byte* state) const {
  const auto first = first_row_by_object_.find(spec.number);
  const Cursor cursor{first == first_row_by_object_.end() ? static_cast<std::uint32_t>(rows_.size()) : first->second,
                      0};
  std::memcpy(state, &cursor, sizeof cursor);
}

void ReplayModel::move(std::uint64_t frame, std::span<const MotionInput> inputs,
                       std::span<MotionOutput> outputs) const {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    Cursor cursor;
    std::memcpy(&cursor, inputs[i].state, sizeof cursor);
    // Applies more than one row only after frames in which the server received no state from the object's host.
    while (cursor.next < rows_.size() && rows_[cursor.next].object == inputs[i].number &&
           rows_[cursor.next].frame <= frame) {
      const MotionRow& row = rows_[cursor.next];
      outputs[i].enabled = row.present;
      outputs[i].jump |= row.jump;
      if (row.present) outputs[i].pose = row.pose;
      ++cursor.next;
    }
    std::memcpy(outputs[i].state, &cursor, sizeof cursor);
  }
}

}  // namespace ringfence::worlds
