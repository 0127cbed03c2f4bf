#include "messages/header.hpp"

#include "messages/records.hpp"

namespace ringfence::messages {

Traffic traffic_of(MessageType type) noexcept {
  switch (type) {
    case MessageType::state_update:
      return Traffic::m1;
    case MessageType::position_update:
    case MessageType::pairs:
    case MessageType::ghost:
      return Traffic::m2;
    case MessageType::collision:
    case MessageType::change:
      return Traffic::m3;
    case MessageType::correct:
    case MessageType::unlist:
    case MessageType::notify:
      return Traffic::m4;
    case MessageType::hand_over:
      return Traffic::m5;
    case MessageType::node_state:
    case MessageType::replica:
      return Traffic::state;
    default:
      return Traffic::control;
  }
}

const char* name_of(MessageType type) noexcept {
  constexpr const char* names[message_types] = {"none",        "adopt",        "drop",         "place",
                                                "frame_begin", "state_update", "node_state",   "position_update",
                                                "pairs",       "collision",    "narrow_done",  "notify",
                                                "region_map",  "frame_end",    "hand_over",    "frame_done",
                                                "refused",     "kinds",        "correct",      "lost",
                                                "probe",       "probe_reply",  "published",    "read_publications",
                                                "change",      "ghost",        "ghost_counts", "contact_counts",
                                                "ghosts_sent", "replica",      "query",        "query_hit",
                                                "sensed",      "unlist"};
  const auto index = static_cast<std::uint16_t>(type);
  return index < message_types ? names[index] : "unknown";
}

std::size_t record_bytes(MessageType type, std::size_t state_bytes) noexcept {
  switch (type) {
    case MessageType::adopt:
    case MessageType::hand_over:
      return sizeof(HandOverRecord) + state_bytes;
    case MessageType::drop:
      return sizeof(DropRecord);
    case MessageType::place:
      return sizeof(PlaceRecord);
    case MessageType::frame_begin:
    case MessageType::probe:
    case MessageType::probe_reply:
    case MessageType::published:
    case MessageType::read_publications:
      return 0;
    case MessageType::lost:
      return sizeof(LostRecord);
    case MessageType::state_update:
      return sizeof(StateRecord) + state_bytes;
    case MessageType::node_state:
      return sizeof(NodeStateRecord) + state_bytes;
    case MessageType::replica:
      return sizeof(ReplicaRecord) + state_bytes;
    case MessageType::position_update:
    case MessageType::ghost:
      return sizeof(PositionRecord);
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return sizeof(CountRecord);
    case MessageType::ghosts_sent:
      return sizeof(GhostsSentRecord);
    case MessageType::pairs:
      return sizeof(PairRecord);
    case MessageType::collision:
      return sizeof(CollisionRecord);
    case MessageType::narrow_done:
      return sizeof(NarrowDoneRecord);
    case MessageType::notify:
      return sizeof(Contact);
    case MessageType::change:
      return sizeof(ChangeRecord);
    case MessageType::correct:
      return sizeof(CorrectRecord);
    case MessageType::unlist:
      return sizeof(UnlistRecord);
    case MessageType::region_map:
      return sizeof(OwnerRecord);
    case MessageType::frame_end:
      return sizeof(FrameEndRecord);
    case MessageType::frame_done:
      return sizeof(NodeFrameStats);
    case MessageType::kinds:
      return sizeof(KindRecord);
    case MessageType::query:
      return sizeof(QueryRecord);
    case MessageType::query_hit:
      return sizeof(QueryHitRecord);
    case MessageType::sensed:
      return sizeof(SensedRecord);
    case MessageType::refused:
      return sizeof(RefusedRecord);
  }
  return 0;
}

Status decode(std::span<const std::byte> bytes, std::size_t state_bytes, MessageView& out) noexcept {
  if (bytes.size() < sizeof(Header)) {
    return Status::bad_message;
  }
  Header header;
  std::memcpy(&header, bytes.data(), sizeof(Header));
  const bool known = header.version == protocol_version && header.type >= 1 && header.type < message_types;
  if (!known || header.last > 1 || header.bytes != bytes.size() ||
      header.record_bytes != record_bytes(static_cast<MessageType>(header.type), state_bytes) ||
      sizeof(Header) + std::uint64_t{header.count} * header.record_bytes != bytes.size() ||
      (header.record_bytes == 0 && header.count != 0)) {
    return Status::bad_message;
  }
  out.header_ = header;
  out.records_ = bytes.data() + sizeof(Header);
  return Status::ok;
}

}  // namespace ringfence::messages
