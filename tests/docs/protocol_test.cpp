// Compares the tables of docs/protocol.md, which describe every byte of messages and records, with the structs.
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "docs/pages.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "ringfence/seen_state.hpp"
#include "ringfence/status.hpp"

namespace ringfence::docs {
namespace {

using namespace messages;
using geometry::Bounds;

template <class T>
std::string name_of_type() {
  if constexpr (std::is_array_v<T>) {
    return name_of_type<std::remove_extent_t<T>>().append("[").append(std::to_string(std::extent_v<T>)).append("]");
  } else if constexpr (std::is_enum_v<T>) {
    return name_of_type<std::underlying_type_t<T>>();
  } else if constexpr (std::is_floating_point_v<T>) {
    return std::string("f").append(std::to_string(8 * sizeof(T)));
  } else if constexpr (std::is_unsigned_v<T>) {
    return std::string("u").append(std::to_string(8 * sizeof(T)));
  } else if constexpr (std::is_same_v<T, Vec3d>) {
    return "f64[3]";
  } else if constexpr (std::is_same_v<T, Vec3f>) {
    return "f32[3]";
  } else if constexpr (std::is_same_v<T, Quat>) {
    return "f32[4]";
  } else if constexpr (std::is_same_v<T, Pose>) {
    return "Pose";
  } else if constexpr (std::is_same_v<T, Bounds>) {
    return "Bounds";
  } else if constexpr (std::is_same_v<T, ObjectRef>) {
    return "ObjectRef";
  } else {
    static_assert(std::is_same_v<T, Contact>);
    return "Contact";
  }
}

struct Field {
  std::string name;
  std::size_t offset, bytes;
  std::string type;
};

template <class T>
Field field(const char* name, std::size_t offset) {
  return {name, offset, sizeof(T), name_of_type<T>()};
}

struct Layout {
  std::string name;
  std::size_t bytes;
  std::vector<Field> fields;
};

std::vector<Layout> base_layouts() {
  return {
      {"Pose",
       sizeof(Pose),
       {field<Vec3d>("position", offsetof(Pose, position)), field<Quat>("orientation", offsetof(Pose, orientation))}},
      {"Bounds",
       sizeof(Bounds),
       {field<std::uint32_t[3]>("lower", offsetof(Bounds, lower)),
        field<std::uint32_t[3]>("upper", offsetof(Bounds, upper))}},
      {"ObjectRef",
       sizeof(ObjectRef),
       {field<decltype(ObjectRef::slot)>("slot", offsetof(ObjectRef, slot)),
        field<decltype(ObjectRef::generation)>("generation", offsetof(ObjectRef, generation)),
        field<decltype(ObjectRef::number)>("number", offsetof(ObjectRef, number)),
        field<decltype(ObjectRef::flags)>("flags", offsetof(ObjectRef, flags))}},
      {"Contact",
       sizeof(Contact),
       {field<decltype(Contact::a)>("a", offsetof(Contact, a)), field<decltype(Contact::b)>("b", offsetof(Contact, b)),
        field<decltype(Contact::phase)>("phase", offsetof(Contact, phase)),
        field<decltype(Contact::depth)>("depth", offsetof(Contact, depth)),
        field<decltype(Contact::normal)>("normal", offsetof(Contact, normal)),
        field<decltype(Contact::toi)>("toi", offsetof(Contact, toi)),
        field<decltype(Contact::point)>("point", offsetof(Contact, point)),
        field<decltype(Contact::arm_a)>("arm_a", offsetof(Contact, arm_a)),
        field<decltype(Contact::arm_b)>("arm_b", offsetof(Contact, arm_b)),
        field<decltype(Contact::generation_a)>("generation_a", offsetof(Contact, generation_a)),
        field<decltype(Contact::generation_b)>("generation_b", offsetof(Contact, generation_b)),
        field<decltype(Contact::user_data_a)>("user_data_a", offsetof(Contact, user_data_a)),
        field<decltype(Contact::user_data_b)>("user_data_b", offsetof(Contact, user_data_b)),
        field<decltype(Contact::child_a)>("child_a", offsetof(Contact, child_a)),
        field<decltype(Contact::child_b)>("child_b", offsetof(Contact, child_b)),
        field<decltype(Contact::layer_a)>("layer_a", offsetof(Contact, layer_a)),
        field<decltype(Contact::layer_b)>("layer_b", offsetof(Contact, layer_b)),
        field<decltype(Contact::flags)>("flags", offsetof(Contact, flags))}},
      {"SeenState",
       sizeof(SeenState),
       {field<decltype(SeenState::number)>("number", offsetof(SeenState, number)),
        field<decltype(SeenState::flags)>("flags", offsetof(SeenState, flags)),
        field<decltype(SeenState::pose)>("pose", offsetof(SeenState, pose))}},
  };
}

Layout header_layout() {
  return {"Header",
          sizeof(Header),
          {field<decltype(Header::version)>("version", offsetof(Header, version)),
           field<decltype(Header::type)>("type", offsetof(Header, type)),
           field<decltype(Header::record_bytes)>("record_bytes", offsetof(Header, record_bytes)),
           field<decltype(Header::last)>("last", offsetof(Header, last)),
           field<decltype(Header::source)>("source", offsetof(Header, source)),
           field<decltype(Header::destination)>("destination", offsetof(Header, destination)),
           field<decltype(Header::frame)>("frame", offsetof(Header, frame)),
           field<decltype(Header::epoch)>("epoch", offsetof(Header, epoch)),
           field<decltype(Header::count)>("count", offsetof(Header, count)),
           field<decltype(Header::bytes)>("bytes", offsetof(Header, bytes)),
           field<decltype(Header::reserved)>("reserved", offsetof(Header, reserved)),
           field<decltype(Header::total)>("total", offsetof(Header, total))}};
}

std::vector<Layout> record_layouts() {
  using Stats = NodeFrameStats;
  return {
      {"StateRecord",
       sizeof(StateRecord),
       {field<ObjectRef>("object", offsetof(StateRecord, object)), field<Pose>("pose", offsetof(StateRecord, pose))}},
      {"NodeStateRecord",
       sizeof(NodeStateRecord),
       {field<ObjectRef>("object", offsetof(NodeStateRecord, object)),
        field<Pose>("pose", offsetof(NodeStateRecord, pose)),
        field<Bounds>("bounds", offsetof(NodeStateRecord, bounds))}},
      {"ReplicaRecord",
       sizeof(ReplicaRecord),
       {field<decltype(ReplicaRecord::slot)>("slot", offsetof(ReplicaRecord, slot)),
        field<decltype(ReplicaRecord::generation)>("generation", offsetof(ReplicaRecord, generation)),
        field<Pose>("pose", offsetof(ReplicaRecord, pose))}},
      {"PositionRecord",
       sizeof(PositionRecord),
       {field<ObjectRef>("object", offsetof(PositionRecord, object)),
        field<Pose>("pose", offsetof(PositionRecord, pose)), field<Bounds>("bounds", offsetof(PositionRecord, bounds)),
        field<decltype(PositionRecord::shape)>("shape", offsetof(PositionRecord, shape)),
        field<decltype(PositionRecord::layer)>("layer", offsetof(PositionRecord, layer)),
        field<decltype(PositionRecord::category)>("category", offsetof(PositionRecord, category)),
        field<decltype(PositionRecord::group)>("group", offsetof(PositionRecord, group)),
        field<decltype(PositionRecord::crowd)>("crowd", offsetof(PositionRecord, crowd)),
        field<decltype(PositionRecord::user_data)>("user_data", offsetof(PositionRecord, user_data))}},
      {"PairRecord",
       sizeof(PairRecord),
       {field<decltype(PairRecord::a)>("a", offsetof(PairRecord, a)),
        field<decltype(PairRecord::b)>("b", offsetof(PairRecord, b))}},
      {"CollisionRecord",
       sizeof(CollisionRecord),
       {field<decltype(CollisionRecord::slot_a)>("slot_a", offsetof(CollisionRecord, slot_a)),
        field<decltype(CollisionRecord::slot_b)>("slot_b", offsetof(CollisionRecord, slot_b)),
        field<decltype(CollisionRecord::reserved)>("reserved", offsetof(CollisionRecord, reserved)),
        field<decltype(CollisionRecord::depth)>("depth", offsetof(CollisionRecord, depth)),
        field<Vec3f>("normal", offsetof(CollisionRecord, normal)),
        field<Vec3f>("point", offsetof(CollisionRecord, point))}},
      {"ChangeRecord",
       sizeof(ChangeRecord),
       {field<decltype(ChangeRecord::key)>("key", offsetof(ChangeRecord, key)),
        field<decltype(ChangeRecord::position)>("position", offsetof(ChangeRecord, position)),
        field<decltype(ChangeRecord::flags)>("flags", offsetof(ChangeRecord, flags))}},
      {"UnlistRecord", sizeof(UnlistRecord), {field<decltype(UnlistRecord::key)>("key", offsetof(UnlistRecord, key))}},
      {"CorrectRecord",
       sizeof(CorrectRecord),
       {field<decltype(CorrectRecord::position)>("position", offsetof(CorrectRecord, position)),
        field<decltype(CorrectRecord::reserved)>("reserved", offsetof(CorrectRecord, reserved))}},
      {"NarrowDoneRecord",
       sizeof(NarrowDoneRecord),
       {field<decltype(NarrowDoneRecord::candidates)>("candidates", offsetof(NarrowDoneRecord, candidates)),
        field<decltype(NarrowDoneRecord::tested)>("tested", offsetof(NarrowDoneRecord, tested)),
        field<decltype(NarrowDoneRecord::carried)>("carried", offsetof(NarrowDoneRecord, carried)),
        field<decltype(NarrowDoneRecord::contacts)>("contacts", offsetof(NarrowDoneRecord, contacts)),
        field<decltype(NarrowDoneRecord::failed_supports)>("failed_supports",
                                                           offsetof(NarrowDoneRecord, failed_supports))}},
      {"HandOverRecord",
       sizeof(HandOverRecord),
       {field<ObjectRef>("object", offsetof(HandOverRecord, object)),
        field<Pose>("pose", offsetof(HandOverRecord, pose)),
        field<decltype(HandOverRecord::user_data)>("user_data", offsetof(HandOverRecord, user_data)),
        field<decltype(HandOverRecord::shape)>("shape", offsetof(HandOverRecord, shape)),
        field<decltype(HandOverRecord::layer)>("layer", offsetof(HandOverRecord, layer)),
        field<decltype(HandOverRecord::category)>("category", offsetof(HandOverRecord, category)),
        field<decltype(HandOverRecord::group)>("group", offsetof(HandOverRecord, group)),
        field<decltype(HandOverRecord::reserved)>("reserved", offsetof(HandOverRecord, reserved))}},
      {"DropRecord", sizeof(DropRecord), {field<ObjectRef>("object", offsetof(DropRecord, object))}},
      {"PlaceRecord",
       sizeof(PlaceRecord),
       {field<ObjectRef>("object", offsetof(PlaceRecord, object)), field<Pose>("pose", offsetof(PlaceRecord, pose))}},
      {"OwnerRecord",
       sizeof(OwnerRecord),
       {field<decltype(OwnerRecord::owner)>("owner", offsetof(OwnerRecord, owner)),
        field<decltype(OwnerRecord::reserved)>("reserved", offsetof(OwnerRecord, reserved))}},
      {"FrameEndRecord",
       sizeof(FrameEndRecord),
       {field<decltype(FrameEndRecord::hand_overs)>("hand_overs", offsetof(FrameEndRecord, hand_overs)),
        field<decltype(FrameEndRecord::contacts)>("contacts", offsetof(FrameEndRecord, contacts)),
        field<decltype(FrameEndRecord::hosts_exchange_objects)>("hosts_exchange_objects",
                                                                offsetof(FrameEndRecord, hosts_exchange_objects)),
        field<decltype(FrameEndRecord::reserved)>("reserved", offsetof(FrameEndRecord, reserved))}},
      {"CountRecord",
       sizeof(CountRecord),
       {field<decltype(CountRecord::node)>("node", offsetof(CountRecord, node)),
        field<decltype(CountRecord::count)>("count", offsetof(CountRecord, count))}},
      {"GhostsSentRecord",
       sizeof(GhostsSentRecord),
       {field<decltype(GhostsSentRecord::ghosts)>("ghosts", offsetof(GhostsSentRecord, ghosts))}},
      {"NodeFrameStats",
       sizeof(Stats),
       {field<decltype(Stats::busy_ns)>("busy_ns", offsetof(Stats, busy_ns)),
        field<decltype(Stats::cpu_ns)>("cpu_ns", offsetof(Stats, cpu_ns)),
        field<decltype(Stats::move_ns)>("move_ns", offsetof(Stats, move_ns)),
        field<decltype(Stats::broad_phase_ns)>("broad_phase_ns", offsetof(Stats, broad_phase_ns)),
        field<decltype(Stats::narrow_phase_ns)>("narrow_phase_ns", offsetof(Stats, narrow_phase_ns)),
        field<decltype(Stats::hosted)>("hosted", offsetof(Stats, hosted)),
        field<decltype(Stats::handed_over)>("handed_over", offsetof(Stats, handed_over)),
        field<decltype(Stats::model_failed)>("model_failed", offsetof(Stats, model_failed)),
        field<decltype(Stats::not_finite)>("not_finite", offsetof(Stats, not_finite)),
        field<decltype(Stats::not_unit)>("not_unit", offsetof(Stats, not_unit)),
        field<decltype(Stats::m5_messages)>("m5_messages", offsetof(Stats, m5_messages)),
        field<decltype(Stats::m5_bytes)>("m5_bytes", offsetof(Stats, m5_bytes)),
        field<decltype(Stats::published)>("published", offsetof(Stats, published)),
        field<decltype(Stats::move_cpu_ns)>("move_cpu_ns", offsetof(Stats, move_cpu_ns)),
        field<decltype(Stats::detect_cpu_ns)>("detect_cpu_ns", offsetof(Stats, detect_cpu_ns)),
        field<decltype(Stats::host_owned_changes)>("host_owned_changes", offsetof(Stats, host_owned_changes)),
        field<decltype(Stats::publish_cpu_ns)>("publish_cpu_ns", offsetof(Stats, publish_cpu_ns)),
        field<decltype(Stats::query_ns)>("query_ns", offsetof(Stats, query_ns)),
        field<decltype(Stats::query_boxes)>("query_boxes", offsetof(Stats, query_boxes)),
        field<decltype(Stats::query_tests)>("query_tests", offsetof(Stats, query_tests)),
        field<decltype(Stats::query_failed_supports)>("query_failed_supports",
                                                      offsetof(Stats, query_failed_supports))}},
      {"QueryRecord",
       sizeof(QueryRecord),
       {field<decltype(QueryRecord::kind)>("kind", offsetof(QueryRecord, kind)),
        field<decltype(QueryRecord::shape)>("shape", offsetof(QueryRecord, shape)),
        field<Pose>("start", offsetof(QueryRecord, start)),
        field<Vec3d>("displacement", offsetof(QueryRecord, displacement)),
        field<decltype(QueryRecord::distance)>("distance", offsetof(QueryRecord, distance)),
        field<decltype(QueryRecord::layers)>("layers", offsetof(QueryRecord, layers)),
        field<decltype(QueryRecord::categories)>("categories", offsetof(QueryRecord, categories)),
        field<decltype(QueryRecord::except_group)>("except_group", offsetof(QueryRecord, except_group)),
        field<decltype(QueryRecord::except_number)>("except_number", offsetof(QueryRecord, except_number)),
        field<decltype(QueryRecord::except_generation)>("except_generation", offsetof(QueryRecord, except_generation)),
        field<decltype(QueryRecord::reserved)>("reserved", offsetof(QueryRecord, reserved))}},
      {"SensedRecord",
       sizeof(SensedRecord),
       {field<Pose>("pose", offsetof(SensedRecord, pose)),
        field<decltype(SensedRecord::user_data)>("user_data", offsetof(SensedRecord, user_data)),
        field<decltype(SensedRecord::number)>("number", offsetof(SensedRecord, number)),
        field<decltype(SensedRecord::generation)>("generation", offsetof(SensedRecord, generation)),
        field<decltype(SensedRecord::shape)>("shape", offsetof(SensedRecord, shape)),
        field<decltype(SensedRecord::group)>("group", offsetof(SensedRecord, group)),
        field<decltype(SensedRecord::layer)>("layer", offsetof(SensedRecord, layer)),
        field<decltype(SensedRecord::category)>("category", offsetof(SensedRecord, category)),
        field<decltype(SensedRecord::reserved)>("reserved", offsetof(SensedRecord, reserved))}},
      {"QueryHitRecord",
       sizeof(QueryHitRecord),
       {field<decltype(QueryHitRecord::query)>("query", offsetof(QueryHitRecord, query)),
        field<decltype(QueryHitRecord::slot)>("slot", offsetof(QueryHitRecord, slot)),
        field<decltype(QueryHitRecord::child)>("child", offsetof(QueryHitRecord, child)),
        field<decltype(QueryHitRecord::triangle)>("triangle", offsetof(QueryHitRecord, triangle)),
        field<decltype(QueryHitRecord::place)>("place", offsetof(QueryHitRecord, place)),
        field<Vec3d>("point", offsetof(QueryHitRecord, point)),
        field<Vec3d>("normal", offsetof(QueryHitRecord, normal))}},
      {"KindRecord",
       sizeof(KindRecord),
       {field<decltype(KindRecord::first)>("first", offsetof(KindRecord, first)),
        field<decltype(KindRecord::second)>("second", offsetof(KindRecord, second)),
        field<decltype(KindRecord::candidates)>("candidates", offsetof(KindRecord, candidates)),
        field<decltype(KindRecord::hits)>("hits", offsetof(KindRecord, hits)),
        field<decltype(KindRecord::lanes)>("lanes", offsetof(KindRecord, lanes)),
        field<decltype(KindRecord::lanes_filled)>("lanes_filled", offsetof(KindRecord, lanes_filled)),
        field<decltype(KindRecord::iterations)>("iterations", offsetof(KindRecord, iterations)),
        field<decltype(KindRecord::ended_early)>("ended_early", offsetof(KindRecord, ended_early)),
        field<decltype(KindRecord::timed)>("timed", offsetof(KindRecord, timed)),
        field<decltype(KindRecord::nanoseconds)>("nanoseconds", offsetof(KindRecord, nanoseconds)),
        field<decltype(KindRecord::gather_nanoseconds)>("gather_nanoseconds", offsetof(KindRecord, gather_nanoseconds)),
        field<decltype(KindRecord::cost)>("cost", offsetof(KindRecord, cost))}},
      {"LostRecord",
       sizeof(LostRecord),
       {field<decltype(LostRecord::node)>("node", offsetof(LostRecord, node)),
        field<decltype(LostRecord::detect_again)>("detect_again", offsetof(LostRecord, detect_again)),
        field<decltype(LostRecord::hand_overs)>("hand_overs", offsetof(LostRecord, hand_overs)),
        field<decltype(LostRecord::contacts)>("contacts", offsetof(LostRecord, contacts))}},
      {"RefusedRecord",
       sizeof(RefusedRecord),
       {field<decltype(RefusedRecord::number)>("number", offsetof(RefusedRecord, number)),
        field<decltype(RefusedRecord::reason)>("reason", offsetof(RefusedRecord, reason))}},
  };
}

std::vector<Layout> layouts() {
  std::vector<Layout> all = base_layouts();
  all.push_back(header_layout());
  const std::vector<Layout> records = record_layouts();
  all.insert(all.end(), records.begin(), records.end());
  return all;
}

const std::string& page() {
  static const std::string text = read_file(root / "docs" / "protocol.md");
  return text;
}

// Fails if a field is added to a struct but not to its list above, which the tests below compare with the page.
TEST_CASE("the lists of fields in this test are complete") {
  for (const Layout& layout : layouts()) {
    CAPTURE(layout.name);
    std::size_t next = 0;
    for (const Field& each : layout.fields) {
      CHECK_MESSAGE(each.offset == next, "before " << each.name);
      next = each.offset + each.bytes;
    }
    CHECK(next == layout.bytes);
  }
}

TEST_CASE("the protocol page has every field of every record, with its offset, size and type") {
  for (const Layout& layout : layouts()) {
    CAPTURE(layout.name);
    const auto rows = table_after(page(), "### " + layout.name + ", " + std::to_string(layout.bytes) + " bytes");
    REQUIRE(rows.size() == layout.fields.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Field& each = layout.fields[i];
      REQUIRE(rows[i].size() == 5);
      CHECK(rows[i][0] == std::to_string(each.offset));
      CHECK(rows[i][1] == std::to_string(each.bytes));
      CHECK(rows[i][2] == each.name);
      CHECK(rows[i][3] == each.type);
      CHECK_FALSE(rows[i][4].empty());
    }
  }
}

const char* page_name_of(Traffic traffic) {
  constexpr const char* names[] = {"M1", "M2", "M3", "M4", "M5", "state", "control"};
  return names[static_cast<std::size_t>(traffic)];
}

TEST_CASE("the protocol page has every message type, with its number, record size and kind of traffic") {
  const auto rows = table_after(page(), "## Message types");
  REQUIRE(rows.size() == message_types - 1u);
  for (std::uint16_t number = 1; number < message_types; ++number) {
    const auto type = static_cast<MessageType>(number);
    const auto& row = rows[number - 1u];
    CAPTURE(name_of(type));
    REQUIRE(row.size() == 6);
    CHECK(row[0] == std::to_string(number));
    CHECK(row[1] == name_of(type));
    const std::size_t fixed = record_bytes(type, 0);
    const bool with_state = record_bytes(type, 8) != fixed;
    CHECK(row[3] == std::to_string(fixed) + (with_state ? " + state" : ""));
    CHECK(row[4] == page_name_of(traffic_of(type)));
  }
}

TEST_CASE("the protocol page has every status, with its number") {
  const auto rows = table_after(page(), "## Status");
  REQUIRE(rows.size() == status_count);
  for (std::size_t i = 0; i < status_count; ++i) {
    CHECK(rows[i][0] == std::to_string(i));
    CHECK(rows[i][1] == name_of(static_cast<Status>(i)));
  }
}

}  // namespace
}  // namespace ringfence::docs
