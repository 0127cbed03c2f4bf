#include "gateway/clients/object_table.hpp"

namespace ringfence::gateway {
namespace {

constexpr Stamp property_period = 16;
constexpr Stamp removal_period = 1024;

}  // namespace

ObjectTable::ObjectTable(const World& world) : world_(world) {}

void ObjectTable::begin_frame(Stamp now) {
  now_ = now;
  if (now % removal_period == 0) remove_unseen();
}

std::uint32_t ObjectTable::refresh(ObjectNumber number, const Pose& pose) {
  std::uint32_t at = index_.find(number);
  if (at == none) {
    at = static_cast<std::uint32_t>(rows_.size());
    rows_.emplace_back().number = number;
    index_.set(number, at);
  }
  SharedObject& row = rows_[at];
  if (row.checked != now_) {
    row.checked = now_;
    compare(row, pose);
  }
  return row.generation == 0 ? none : at;
}

void ObjectTable::compare(SharedObject& row, const Pose& pose) {
  const std::uint32_t generation = world_.find(row.number).generation();
  if (generation != row.generation) {
    row.generation = generation;
    if (generation == 0) return;
    compare_properties(row);
    row.changed = now_;
  } else if ((row.number + now_) % property_period == 0 && compare_properties(row)) {
    row.changed = now_;
  }
  if (const QuantisedPosition position = quantise(pose.position); position != row.position || row.moved == 0) {
    row.position = position;
    row.moved = now_;
  }
  if (const std::uint32_t turn = quantise(pose.orientation); turn != row.turn || row.turned == 0) {
    row.turn = turn;
    row.turned = now_;
  }
}

bool ObjectTable::compare_properties(SharedObject& row) {
  const ObjectSpec spec = world_.object(ObjectId::of(row.number, row.generation)).spec;
  if (spec.shape == row.shape && spec.category == row.category && spec.user == row.user) return false;
  row.shape = spec.shape;
  row.category = spec.category;
  row.user = spec.user;
  return true;
}

void ObjectTable::remove_unseen() {
  std::vector<SharedObject> kept;
  kept.reserve(rows_.size());
  base::NumberIndex index(rows_.size());
  for (const SharedObject& row : rows_) {
    if (row.checked + removal_period < now_) continue;
    index.set(row.number, static_cast<std::uint32_t>(kept.size()));
    kept.push_back(row);
  }
  rows_ = std::move(kept);
  index_ = std::move(index);
}

}  // namespace ringfence::gateway
