#include "facade/queries/frame_recorder.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "base/frame_stamp.hpp"
#include "base/stream_lines.hpp"
#include "nodes/cd_node/region_objects.hpp"
#include "queries/tree_box.hpp"

namespace ringfence::facade {
namespace {

using nodes::ObjectTable;
using nodes::RegionObjects;
using queries::FrameObject;
using queries::RecordedFrame;
using NewRows = RecordedFrame::NewRows;

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

/// Records the objects in the order in which they are in memory: those that CD nodes host and know, and then those in
/// the table. All lists are copied from front to back, many objects at a time.
class Recorder {
 public:
  Recorder(const nodes::ServerRole& server, RecordedFrame& frame)
      : server_(server), table_(server.objects()), frame_(frame), shapes_(server.shapes()) {}

  void record(std::uint64_t number, bool with_bounds) {
    frame_.begin(table_.slots(), !table_.groups().empty());
    if (with_bounds) frame_.begin_bounds(server_.space(), origin_of(table_));
    server_.each_in_node(
        [&](const RegionObjects& known, std::size_t first, std::size_t count) { add_known(known, first, count); });
    const std::size_t in_nodes = frame_.size();
    const Count count = count_present();
    if (count.in_nodes != count.all) record_table();
    if (count.in_nodes != in_nodes) record_missing(base::stamp_of(number));
    base::finish_streams();
    frame_.finish(number);
  }

 private:
  void add_known(const RegionObjects& known, std::size_t first, std::size_t count) {
    const std::span<const std::uint32_t> slots = known.slots().subspan(first, count);
    const NewRows rows = frame_.add(slots);
    const std::span<const FrameObject> bodies = known.bodies().subspan(first, count);
    // Without bounds it is a frame of a history, which is rarely read.
    if (rows.bounds.empty()) {
      base::stream_lines(bodies, rows.objects.data());
    } else {
      std::copy(bodies.begin(), bodies.end(), rows.objects.begin());
    }
    const std::span<const std::uint32_t> groups = known.groups();
    for (std::size_t i = 0; i < rows.groups.size(); ++i) rows.groups[i] = groups.empty() ? 0 : groups[first + i];
    const std::span<const nodes::ObjectMarks> marks = table_.marks();
    for (std::size_t i = 0; i < count; ++i) rows.jumped[i] = has_jumped(marks[slots[i]]);
    if (rows.bounds.empty()) return;
    std::copy_n(known.changed().begin() + first, count, rows.changed.begin());
    for (std::size_t i = 0; i < count; ++i) {
      rows.bounds[i] = {known.bounds()[first + i], margin_of(rows.objects[i])};
    }
  }

  /// Numbers of present objects. In most worlds nodes host most of them, so this is all that looks at each slot.
  struct Count {
    std::size_t all = 0;
    std::size_t in_nodes = 0;  ///< that each_in_node() should have visited
  };
  Count count_present() const noexcept {
    const std::span<const std::uint8_t> present = table_.present();
    const std::span<const messages::Endpoint> hosts = table_.hosts();
    std::uint32_t all = 0, in_nodes = 0;
    for (std::size_t slot = 0; slot < present.size(); ++slot) {
      all += present[slot];
      in_nodes += present[slot] & static_cast<std::uint32_t>(hosts[slot].is_node());
    }
    return {all, server_.reads_hosts() ? in_nodes : 0};
  }
  bool is_in_node(std::uint32_t slot) const noexcept { return server_.reads_hosts() && table_.host(slot).is_node(); }

  void record_table() {
    for (std::uint32_t slot = 0; slot < table_.slots(); ++slot) {
      if (table_.present()[slot] != 0 && !is_in_node(slot)) add(slot);
    }
  }

  /// Records the objects that their hosts do not know.
  void record_missing(base::FrameStamp now) {
    thread_local std::vector<bool> recorded;
    recorded.assign(table_.slots(), false);
    for (const std::uint32_t slot : frame_.slots()) recorded[slot] = true;
    for (std::uint32_t slot = 0; slot < table_.slots(); ++slot) {
      if (table_.present()[slot] == 0 || recorded[slot]) continue;
      const NewRows row = add(slot);
      FrameObject& object = row.objects[0];
      object.pose = server_.pose(slot);
      if (row.bounds.empty()) continue;
      row.bounds[0].bounds = shapes_.bounds(object.shape, object.pose, server_.space());
      row.changed[0] = now;
    }
  }

  /// Adds an object as the table has it.
  NewRows add(std::uint32_t slot) {
    const nodes::ObjectRow& of = table_.row(slot);
    const NewRows row = frame_.add({&slot, 1});
    FrameObject& object = row.objects[0];
    object = {of.pose,
              of.shape,
              of.object.number,
              of.object.generation,
              of.layer,
              of.category,
              table_.origin(slot).user_data};
    row.jumped[0] = has_jumped(table_.marks(slot));
    if (!row.groups.empty()) row.groups[0] = table_.group(slot);
    if (row.bounds.empty()) return row;
    const bool known = server_.has_bounds() && !server_.is_in_host(slot);
    row.bounds[0] = {known ? table_.bounds()[slot] : shapes_.bounds(object.shape, object.pose, server_.space()),
                     margin_of(object)};
    row.changed[0] = table_.changed()[slot];
    return row;
  }

  /// A host-owned object has not jumped: then it would not be host-owned.
  static std::uint8_t has_jumped(nodes::ObjectMarks marks) noexcept {
    return (marks & (nodes::host_owned_mark | nodes::jumped_mark)) == nodes::jumped_mark ? 1 : 0;
  }
  float margin_of(const FrameObject& object) const noexcept { return queries::margin_of(shapes_.row(object.shape)); }

  const nodes::ServerRole& server_;
  const ObjectTable& table_;
  RecordedFrame& frame_;
  const geometry::ShapeTable& shapes_;
};

}  // namespace

void record_frame(const nodes::ServerRole& server, std::uint64_t number, bool with_bounds, RecordedFrame& frame) {
  Recorder(server, frame).record(number, with_bounds);
}

}  // namespace ringfence::facade
