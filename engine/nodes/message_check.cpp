#include "nodes/message_check.hpp"

#include <cmath>

#include "geometry/vector.hpp"
#include "nodes/host/valid_pose.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/object.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

namespace {

constexpr std::uint32_t layers = 32;

bool is_valid(const geometry::Bounds& bounds) noexcept {
  return bounds.lower[0] <= bounds.upper[0] && bounds.lower[1] <= bounds.upper[1] && bounds.lower[2] <= bounds.upper[2];
}

bool is_valid(const messages::ObjectRef& object, const MessageLimits& limits) noexcept {
  return object.number != 0 && object.slot < limits.slots;
}

bool is_valid(const messages::HandOverRecord& record, const MessageLimits& limits) noexcept {
  constexpr std::uint32_t allowed = messages::flag_present | messages::flag_host_owned;
  return is_valid(record.object, limits) && (record.object.flags & ~allowed) == 0 && is_valid_pose(record.pose) &&
         record.shape < limits.shapes && record.layer < layers &&
         record.category <= static_cast<std::uint16_t>(Category::fixed);
}

bool is_valid(const messages::NodeStateRecord& record, const MessageLimits& limits) noexcept {
  constexpr std::uint32_t allowed = messages::flag_present | messages::flag_interior | messages::flag_keeps_host |
                                    messages::flag_at_rest | messages::flag_host_owned | messages::flag_jumped;
  return is_valid(record.object, limits) && (record.object.flags & ~allowed) == 0 && is_valid_pose(record.pose) &&
         is_valid(record.bounds);
}

bool is_valid(const messages::ReplicaRecord& record, const MessageLimits& limits) noexcept {
  return record.slot < limits.slots && is_valid_pose(record.pose);
}

bool is_valid(const messages::PositionRecord& record, const MessageLimits& limits) noexcept {
  return is_valid(record.object, limits) && is_valid_pose(record.pose) && is_valid(record.bounds) &&
         record.shape < limits.shapes && record.layer < layers &&
         record.category <= static_cast<std::uint16_t>(Category::fixed);
}

bool is_valid(const messages::PlaceRecord& record, const MessageLimits& limits) noexcept {
  return is_valid(record.object, limits) && is_valid_pose(record.pose);
}

bool is_valid(const messages::DropRecord& record, const MessageLimits& limits) noexcept {
  return is_valid(record.object, limits);
}

bool is_valid(const messages::PairRecord& record, const MessageLimits& limits) noexcept {
  return record.a != record.b && record.a < limits.slots && record.b < limits.slots;
}

bool is_valid(const messages::CollisionRecord& record, const MessageLimits& limits) noexcept {
  return record.slot_a != record.slot_b && record.slot_a < limits.slots && record.slot_b < limits.slots &&
         std::isfinite(record.depth) && is_finite(record.normal) && is_finite(record.point);
}

bool is_valid(const messages::CountRecord& record, const MessageLimits& limits) noexcept {
  return record.node < limits.nodes && record.count != 0;
}

bool is_valid(const Contact& contact, const MessageLimits&) noexcept {
  return contact.a != 0 && contact.a < contact.b && static_cast<std::uint32_t>(contact.phase) <= 2 &&
         std::isfinite(contact.depth) && is_finite(contact.normal) && is_finite(contact.point) &&
         is_finite(contact.arm_a) && is_finite(contact.arm_b);
}

bool is_valid(const messages::ChangeRecord& record, const MessageLimits&) noexcept {
  return (record.flags & ~std::uint32_t{messages::change_ended | messages::change_at_border}) == 0;
}

bool is_valid(const messages::UnlistRecord& record, const MessageLimits&) noexcept {
  const std::uint64_t a = record.key >> 32, b = record.key & 0xffffffffu;
  return a != 0 && a < b;
}

bool is_valid(const messages::KindRecord& record, const MessageLimits&) noexcept {
  return record.first < shape_kinds && record.second < shape_kinds;
}

// Whether the shape may move depends on its kind, which the receiver knows.
bool is_valid(const messages::QueryRecord& record, const MessageLimits& limits) noexcept {
  return record.kind < messages::query_kinds && is_valid_pose(record.start) &&
         is_valid_pose({record.displacement, {}}) && record.distance >= 0 &&
         (!messages::has_shape(record) || record.shape < limits.shapes);
}

bool is_valid(const messages::QueryHitRecord& record, const MessageLimits& limits) noexcept {
  return record.slot < limits.slots && std::isfinite(record.place) && record.place >= 0 && is_finite(record.point) &&
         is_finite(record.normal);
}

bool is_valid(const messages::SensedRecord& record, const MessageLimits& limits) noexcept {
  return record.number != 0 && is_valid_pose(record.pose) && record.shape < limits.shapes && record.layer < layers &&
         record.category <= static_cast<std::uint16_t>(Category::fixed);
}

bool is_valid(const messages::LostRecord& record, const MessageLimits&) noexcept { return record.detect_again <= 1; }

template <class Record>
bool are_valid(const MessageView& message, const MessageLimits& limits) noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (!is_valid(message.record<Record>(i), limits)) {
      return false;
    }
  }
  return true;
}

}  // namespace

bool is_valid(const MessageView& message, const MessageLimits& limits) noexcept {
  switch (message.type()) {
    case MessageType::hand_over: {
      const Endpoint from{message.header().source};
      return from.is_node() && from.number() < limits.nodes && are_valid<messages::HandOverRecord>(message, limits);
    }
    case MessageType::adopt:
      return are_valid<messages::HandOverRecord>(message, limits);
    case MessageType::drop:
      return are_valid<messages::DropRecord>(message, limits);
    case MessageType::place:
      return are_valid<messages::PlaceRecord>(message, limits);
    case MessageType::node_state:
      return are_valid<messages::NodeStateRecord>(message, limits);
    case MessageType::replica:
      return are_valid<messages::ReplicaRecord>(message, limits);
    case MessageType::position_update:
    case MessageType::ghost:
      return are_valid<messages::PositionRecord>(message, limits);
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return are_valid<messages::CountRecord>(message, limits);
    case MessageType::pairs:
      return are_valid<messages::PairRecord>(message, limits);
    case MessageType::collision:
      return are_valid<messages::CollisionRecord>(message, limits);
    case MessageType::change:
      return are_valid<messages::ChangeRecord>(message, limits);
    case MessageType::notify:
      return are_valid<Contact>(message, limits);
    case MessageType::unlist:
      return are_valid<messages::UnlistRecord>(message, limits);
    case MessageType::query:
      return are_valid<messages::QueryRecord>(message, limits);
    case MessageType::query_hit:
      return are_valid<messages::QueryHitRecord>(message, limits);
    case MessageType::sensed:
      return are_valid<messages::SensedRecord>(message, limits);
    case MessageType::kinds:
      return are_valid<messages::KindRecord>(message, limits);
    case MessageType::lost:
      return are_valid<messages::LostRecord>(message, limits);
    case MessageType::narrow_done:
    case MessageType::ghosts_sent:
      return message.count() == 1;
    case MessageType::frame_end:
      return message.count() == 1 && message.record<messages::FrameEndRecord>(0).hosts_exchange_objects <= 1;
    case MessageType::frame_done:
      return message.count() == 1 && message.record<messages::NodeFrameStats>(0).host_owned_changes == 0;
    // Other code checks these: the owners of a region map when it is complete, the states of user nodes one by one.
    case MessageType::region_map:
    case MessageType::state_update:
    case MessageType::frame_begin:
    case MessageType::correct:
    case MessageType::refused:
    case MessageType::probe:
    case MessageType::probe_reply:
    case MessageType::published:
    case MessageType::read_publications:
      return true;
  }
  return false;
}

}  // namespace ringfence::nodes
