// Messages that a CD node receives from the server and its peers.
#include <cassert>

#include "base/prefetch.hpp"
#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

// Receives all messages of a connection. Only messages from another process are checked; invalid ones are discarded and
// counted. If there were any, the caller of step() ends the role.
bool CdNodeRole::receive_from(Connection& connection) {
  const bool from_other_process = connection.node_contacts == nullptr;
  return drain(
      *connection.in, host_.state_bytes(),
      [&](const MessageView& message) {
        if (from_other_process && is_late(message)) [[unlikely]] {
          return;
        }
        if (from_other_process && !is_acceptable(message)) [[unlikely]] {
          ++invalid_messages_;
        } else {
          receive(message);
        }
      },
      [this] { ++invalid_messages_; });
}

// Whether the message comes from another node that was lost: such a node may still send in this frame or in later ones.
bool CdNodeRole::is_late(const MessageView& message) const noexcept {
  const Endpoint source{message.header().source};
  return source.is_node() &&
         (message.header().frame != frame_ || (source.number() < lost_.size() && lost_[source.number()] != 0));
}

bool CdNodeRole::is_acceptable(const MessageView& message) const {
  const MessageLimits limits{static_cast<std::uint32_t>(setup_.peers.size()),
                             static_cast<std::uint32_t>(setup_.shapes->size()), setup_.max_slots};
  return is_expected(message) && is_valid(message, limits) &&
         (message.type() != MessageType::pairs || knows_pairs(message)) &&
         (message.type() != MessageType::correct || knows_contacts(message));
}

bool CdNodeRole::knows_contacts(const MessageView& message) const noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (message.record<messages::CorrectRecord>(i).position >= node_contacts_->begun.size()) {
      return false;
    }
  }
  return true;
}

// Whether this node knows all objects of the pairs, and each pair has the object with the lower number first.
bool CdNodeRole::knows_pairs(const MessageView& message) const noexcept {
  const auto numbers = region_objects_.numbers();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto pair = message.record<messages::PairRecord>(i);
    const std::uint32_t a = region_objects_.find(pair.a);
    const std::uint32_t b = region_objects_.find(pair.b);
    if (a == RegionObjects::none || b == RegionObjects::none || numbers[a] >= numbers[b]) {
      return false;
    }
  }
  return true;
}

// Whether the server, or a peer, may send this message at this stage of the frame. At another stage the message would
// change arrays into which the stage holds indices: hosted objects, known objects, peers, or the region map.
bool CdNodeRole::is_expected(const MessageView& message) const {
  const Endpoint source{message.header().source};
  if (message.type() == MessageType::hand_over) {
    const bool open = stage_ == Stage::ending || stage_ == Stage::handing_over || stage_ == Stage::settling;
    return open && source.is_node() && source.number() != setup_.node;
  }
  if (!source.is_server()) {
    return false;
  }
  switch (message.type()) {
    case MessageType::adopt:
    case MessageType::drop:
    case MessageType::place:
      return stage_ == Stage::waiting;
    case MessageType::frame_begin:
      return stage_ == Stage::waiting && map_fits_;
    case MessageType::position_update:
      return (stage_ == Stage::moving || stage_ == Stage::gathering) && !positions_received_;
    case MessageType::pairs:
      return stage_ == Stage::gathering && positions_received_ && !pairs_received_;
    case MessageType::correct:
      return stage_ == Stage::ending && !contacts_received_;
    case MessageType::notify:
      return stage_ == Stage::waiting || (stage_ == Stage::ending && !contacts_received_);
    case MessageType::frame_end:
      return stage_ == Stage::ending && !frame_end_received_;
    case MessageType::region_map:
      return is_map_expected(message);
    case MessageType::lost:
      return is_loss_expected(message);
    case MessageType::probe:
      return true;
    default:
      return false;
  }
}

// A loss must be that of another node. If it requests that the frame is detected again, the contacts must not be final.
// Other losses are ignored after this node has ended the frame, so they are not checked: their slots may be free.
bool CdNodeRole::is_loss_expected(const MessageView& message) const noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::LostRecord>(i);
    if (stage_ == Stage::waiting && record.detect_again == 0) {
      continue;
    }
    if (record.node >= setup_.peers.size() || record.node == setup_.node ||
        (record.detect_again != 0 && stage_ > Stage::ending)) {
      return false;
    }
  }
  return true;
}

// A new map clears the known objects. So it must not arrive between the positions of a frame and the report of the
// contacts: candidates, and contacts that are not sent yet, hold indices of known objects.
bool CdNodeRole::is_map_expected(const MessageView& message) const {
  const bool open = stage_ == Stage::waiting || stage_ == Stage::moving || stage_ == Stage::ending ||
                    (stage_ == Stage::gathering && !positions_received_);
  const std::size_t entries = new_map_.size() + message.count();
  if (!open || entries > regions::RegionMap::max_entries(map_.grid())) {
    return false;
  }
  if (!message.last()) {
    return true;
  }
  std::vector<std::uint32_t> table = new_map_;
  for (std::size_t i = 0; i < message.count(); ++i) {
    table.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  return regions::RegionMap::is_table(table, map_.grid(), static_cast<std::uint32_t>(setup_.peers.size()));
}

// Peers hand over objects between frame_end and the last of the expected hand-overs, so their rings are read only then.
// Polling the rings of all peers at every step would cost 1 % of the work of 16 nodes. A peer that hands over earlier
// may have to wait for room in its ring, but nothing before frame_end depends on it.
bool CdNodeRole::receive_from_peers() {
  if (!frame_end_received_ || stage_ == Stage::reporting || stage_ == Stage::waiting) {
    return false;
  }
  bool any = false;
  for (Connection& peer : setup_.peers) {
    if (peer.in != nullptr) {
      any |= receive_from(peer);
    }
  }
  return any;
}

void CdNodeRole::receive(const MessageView& message) {
  switch (message.type()) {
    case MessageType::hand_over: {
      const NodeNumber from = Endpoint{message.header().source}.number();
      if (lost_[from] != 0) {
        return;  // the server has reclaimed its objects
      }
      hand_overs_received_from_[from] += message.count();
      hand_overs_received_ += message.count();
      host_.adopt(message);
      return;
    }
    case MessageType::frame_begin:
      return begin(message.header().frame);
    case MessageType::position_update:
      return receive_positions(message);
    case MessageType::pairs:
      return receive_pairs(message);
    case MessageType::correct:
      return receive_corrections(message);
    case MessageType::notify:
      return receive_contacts(message);
    case MessageType::region_map:
      return receive_owners(message);
    case MessageType::lost:
      for (std::size_t i = 0; i < message.count(); ++i) {
        receive_lost(message.record<messages::LostRecord>(i));
      }
      return;
    case MessageType::probe:
      return here_run_.start(0);
    case MessageType::frame_end:
      hand_overs_expected_ = message.record<messages::FrameEndRecord>(0).hand_overs;
      frame_end_received_ = true;
      return;
    default:
      host_.apply(message);
  }
}

void CdNodeRole::receive_positions(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    apply_position(record, (record.object.flags & messages::flag_left_region) != 0);
  }
  positions_received_ |= message.last();
}

void CdNodeRole::apply_position(const messages::PositionRecord& record, bool gone) {
  if (gone) {
    region_objects_.remove(record.object.slot);
    return;
  }
  const NextHost next = next_host(record);
  const bool inner = next == NextHost::self && map_.coverage(record.bounds, setup_.node) == regions::Coverage::all;
  const auto filter = [&] {
    return PairFilter::of(record.layer, (record.object.flags & messages::flag_fixed) != 0, record.group);
  };
  region_objects_.set(record, record.bounds, filter, next, inner);
}

// If flag_keeps_host is set, the sender of the update hosts the object in the next frame too. The sender has the same
// map, so the next host is not computed again.
void CdNodeRole::apply_ghost(const messages::PositionRecord& record, bool gone) {
  if (gone || (record.object.flags & messages::flag_keeps_host) == 0) {
    return apply_position(record, gone);
  }
  const auto filter = [&] { return PairFilter::of(record.layer, false, record.group); };  // hosted: not static
  region_objects_.set(record, record.bounds, filter, NextHost::node, false);
}

NextHost CdNodeRole::next_host(const messages::PositionRecord& record) const noexcept {
  if ((record.object.flags & (messages::flag_avatar | messages::flag_fixed)) != 0) {
    return (record.object.flags & messages::flag_avatar) != 0 ? NextHost::user : NextHost::none;
  }
  return setup_.hosts && is_in_own_region(record.pose.position) ? NextHost::self : NextHost::node;
}

void CdNodeRole::receive_pairs(const MessageView& message) {
  const auto bodies = region_objects_.bodies();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& pair = message.view<messages::PairRecord>(i);
    const geometry::CandidatePair known{region_objects_.find(pair.a), region_objects_.find(pair.b)};
    assert(known.a != RegionObjects::none && known.b != RegionObjects::none);
    base::prefetch_for_read(&bodies[known.a]);
    base::prefetch_for_read(&bodies[known.b]);
    pairs_.push_back(known);
    if (pairs_.size() == pairs_per_test) {
      test_pairs();
    }
  }
  pairs_received_ |= message.last();
}

void CdNodeRole::receive_contacts(const MessageView& message) {
  // Between frames these are contacts of the last frame, for an object that was adopted.
  const bool late = stage_ == Stage::waiting;
  late ? host_.add_late_contacts(message) : host_.add_contacts(frame_, message);
  contacts_received_ |= message.last() && !late;
}

void CdNodeRole::receive_corrections(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    own_contacts_.begun[message.record<messages::CorrectRecord>(i).position] = 0;
  }
}

void CdNodeRole::receive_owners(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    new_map_.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  if (message.last()) {
    map_.assign(new_map_, static_cast<std::uint32_t>(setup_.peers.size()), message.header().epoch);
    interior_ = map_.interior(setup_.node);
    map_fits_ = true;
    new_map_.clear();
    // After a change of the map every node receives all objects in its region again: from the server, or from their
    // hosts.
    region_objects_.clear();
    map_is_new_ = true;
    host_.list_all(stage_ == Stage::ending && node_contacts_->hosts_exchange_objects);
  }
}

}  // namespace ringfence::nodes
