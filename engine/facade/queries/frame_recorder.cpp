#include "facade/queries/frame_recorder.hpp"

#include <algorithm>
#include <array>

#include "base/frame_stamp.hpp"
#include "base/prefetch.hpp"
#include "nodes/cd_node/region_objects.hpp"
#include "queries/tree_box.hpp"

namespace ringfence::facade {
namespace {

using nodes::ObjectTable;
using nodes::RegionObjects;
using queries::FrameObject;
using queries::RecordedFrame;

// Field by field: a copy of the whole row would wait for the stores of its last fields.

/// Records an object whose state is in the server's table.
void set_row(const ObjectTable& table, std::uint32_t slot, FrameObject& out) noexcept {
  const nodes::ObjectRow& object = table.row(slot);
  out.pose = object.pose;
  out.shape = object.shape;
  out.number = object.object.number;
  out.generation = object.object.generation;
  out.group = table.group(slot);
  out.slot = slot;
  out.layer = static_cast<std::uint8_t>(object.layer);
  out.category = static_cast<std::uint8_t>(object.category);
  out.jumped = (table.marks(slot) & nodes::jumped_mark) != 0 ? 1 : 0;
}

/// Records an object that the node which knows it hosts. It has not jumped: then its state would be in the table too.
void set_row(const RegionObjects& known, std::uint32_t i, std::uint32_t slot, FrameObject& out) noexcept {
  const narrow_phase::Body& body = known.bodies()[i];
  out.pose = body.pose;
  out.shape = body.shape;
  out.number = body.number;
  out.generation = body.generation;
  out.group = known.groups().empty() ? 0 : known.groups()[i];
  out.slot = slot;
  out.layer = static_cast<std::uint8_t>(body.layer);
  out.category = static_cast<std::uint8_t>(body.category);
  out.jumped = 0;
}

/// Median of the positions of some present objects; see queries::BoxConverter.
Vec3d origin_of(const ObjectTable& table) {
  constexpr std::size_t most = 64;
  std::array<std::array<double, most>, 3> at;
  std::size_t size = 0;
  for (std::size_t i = 0; i < most && i < table.slots(); ++i) {
    const auto slot = static_cast<std::uint32_t>(i * table.slots() / std::min(most, table.slots()));
    if (table.present()[slot] == 0) continue;
    const Vec3d& position = table.row(slot).pose.position;
    at[0][size] = position.x, at[1][size] = position.y, at[2][size] = position.z;
    ++size;
  }
  if (size == 0) return {};
  const auto middle = static_cast<std::ptrdiff_t>(size / 2);
  for (auto& axis : at) std::nth_element(axis.begin(), axis.begin() + middle, axis.begin() + size);
  return {at[0][size / 2], at[1][size / 2], at[2][size / 2]};
}

/// Where the row of a slot was recorded from, so that it can be kept while its source has not changed. 0: nowhere yet.
constexpr std::uint8_t from_nothing = 1, from_table = 2, from_both = 3;
constexpr std::uint8_t from_host(NodeNumber node) noexcept { return static_cast<std::uint8_t>(4 + node % 252); }

/// Records rows and, if wanted, bounds. What has not changed since the frame that was recorded in the same place is
/// left as it is.
class Recorder {
 public:
  Recorder(const nodes::ServerRole& server, RecordedFrame& frame, bool with_bounds)
      : server_(server), table_(server.objects()), frame_(frame), with_bounds_(with_bounds), shapes_(server.shapes()) {}

  /// Returns the number of objects.
  std::size_t record(std::uint64_t number) {
    const std::uint64_t kept = frame_.begin(table_.slots(), number);
    if (with_bounds_) frame_.begin_bounds(server_.space(), origin_of(table_));
    keeps_ = kept != RecordedFrame::none;
    kept_ = base::stamp_of(kept);
    const std::size_t objects = record_table();
    if (record_hosts() != in_hosts_) record_received();
    return objects;
  }

 private:
  static constexpr std::uint32_t ahead = 32;

  /// All slots but those of objects in the memory of a host, whose rows are written only once.
  std::size_t record_table() {
    std::size_t objects = 0;
    for (std::uint32_t slot = 0; slot < table_.slots(); ++slot) {
      // When a host takes an object, it reports a state, which changes the row in the table.
      if (is_kept(slot, from_table, table_.changed()[slot])) {
        ++objects;
        continue;
      }
      prefetch_table(slot + ahead);
      const bool present = table_.present()[slot] != 0, in_host = server_.is_in_host(slot);
      objects += present ? 1 : 0;
      in_hosts_ += present && in_host ? 1 : 0;
      if (present && in_host) continue;
      present ? record_row(slot) : clear(slot);
    }
    return objects;
  }

  /// Returns how many objects the hosts have.
  std::size_t record_hosts() {
    std::size_t found = 0;
    server_.each_in_host([&](NodeNumber node, const RegionObjects& known, std::uint32_t i) {
      const std::uint32_t slot = known.slot(i);
      if (table_.present()[slot] == 0) return;
      ++found;
      if (is_kept(slot, from_host(node), known.changed()[i])) return;
      frame_.source(slot) = from_host(node);
      base::prefetch_for_read(&known.bodies()[i]);
      prefetch_row(slot);
      to_read_[prefetched_++ % ahead] = {&known, i};
      if (prefetched_ - read_ == ahead) read_next();
    });
    while (read_ != prefetched_) read_next();
    return found;
  }

  /// Records the object that was prefetched first.
  void read_next() {
    const auto& [known, i] = to_read_[read_++ % ahead];
    const std::uint32_t slot = known->slot(i);
    set_row(*known, i, slot, frame_.row(slot));
    frame_.set_user_data(slot, known->bodies()[i].user_data);
    if (with_bounds_) set_bounds(slot, known->bounds()[i]);
  }

  /// Some hosts have only just received objects.
  void record_received() {
    keeps_ = false;
    for (std::uint32_t slot = 0; slot < table_.slots(); ++slot) {
      if (server_.is_in_host(slot)) clear(slot);
    }
    (void)record_hosts();
    for (std::uint32_t slot = 0; slot < table_.slots(); ++slot) {
      if (table_.present()[slot] == 0 || frame_.source(slot) != from_nothing) continue;
      FrameObject& row = frame_.row(slot);
      frame_.source(slot) = from_both;  // which is_kept() is never asked for
      set_row(table_, slot, row);
      row.pose = server_.pose(slot);
      row.jumped = 0;
      finish_row(slot);
    }
  }

  bool is_kept(std::uint32_t slot, std::uint8_t source, base::FrameStamp changed) noexcept {
    return keeps_ && frame_.source(slot) == source && !base::may_have_changed(changed, kept_);
  }

  void prefetch_table(std::uint32_t slot) const noexcept {
    if (slot >= table_.slots() || server_.is_in_host(slot) ||
        (keeps_ && !base::may_have_changed(table_.changed()[slot], kept_))) {
      return;
    }
    base::prefetch_for_read(&table_.row(slot));
    prefetch_row(slot);
  }

  void prefetch_row(std::uint32_t slot) const noexcept {
    if (slot >= table_.slots()) return;
    frame_.prefetch_row(slot);
    if (with_bounds_) frame_.prefetch_bounds(slot);
  }

  void clear(std::uint32_t slot) noexcept {
    if (keeps_ && frame_.source(slot) == from_nothing) return;
    frame_.source(slot) = from_nothing;
    frame_.row(slot).number = 0;
    if (with_bounds_) frame_.set_bounds(slot, {{}, -1});
  }

  void record_row(std::uint32_t slot) {
    frame_.source(slot) = from_table;
    set_row(table_, slot, frame_.row(slot));
    finish_row(slot);
  }

  /// What a row from the table needs beside it.
  void finish_row(std::uint32_t slot) {
    frame_.set_user_data(slot, table_.origin(slot).user_data);
    if (!with_bounds_) return;
    const FrameObject& row = frame_.row(slot);
    const bool known = server_.has_bounds() && !server_.is_in_host(slot);
    set_bounds(slot, known ? table_.bounds()[slot] : shapes_.bounds(row.shape, row.pose, server_.space()));
  }

  void set_bounds(std::uint32_t slot, const geometry::Bounds& bounds) noexcept {
    frame_.set_bounds(slot, {bounds, queries::margin_of(shapes_.row(frame_.row(slot).shape))});
  }

  const nodes::ServerRole& server_;
  const ObjectTable& table_;
  RecordedFrame& frame_;
  bool with_bounds_;
  const geometry::ShapeTable& shapes_;
  bool keeps_ = false;         ///< rows of an earlier frame are there
  base::FrameStamp kept_ = 0;  ///< that frame
  std::size_t in_hosts_ = 0;   ///< objects that are still to be recorded
  struct InHost {
    const RegionObjects* known;
    std::uint32_t i;
  };
  std::array<InHost, ahead> to_read_;      ///< objects that are prefetched, in turn
  std::size_t prefetched_ = 0, read_ = 0;  ///< number of objects
};

}  // namespace

void record_frame(const nodes::ServerRole& server, std::uint64_t number, bool with_bounds, RecordedFrame& frame) {
  const std::size_t objects = Recorder(server, frame, with_bounds).record(number);
  frame.finish(number, objects);
}

}  // namespace ringfence::facade
