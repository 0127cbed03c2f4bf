// Messages that a CD node receives from the server and its peers.
#include <cassert>

#include "base/prefetch.hpp"
#include "nodes/cd_node/cd_node_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

bool CdNodeRole::receive_from(Connection& connection) {
  return drain(*connection.in, host_.state_bytes(), [this](const MessageView& message) { receive(message); });
}

// Peers hand over between the end of a frame and the last of the expected hand-overs. Polling the rings of all peers at
// every step would cost 1 % of the work of 16 nodes. A peer that hands over earlier has to wait for room in its ring at
// worst, and nothing before the end of the frame depends on it.
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
    case MessageType::confirm:
      return receive_confirmed(message);
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
  region_objects_.set(record.object, record.pose, record.bounds, record.shape, record.layer, next, inner);
}

// The update comes from the object's host, which has the same map.
void CdNodeRole::apply_ghost(const messages::PositionRecord& record, bool gone) {
  if (gone || (record.object.flags & messages::flag_keeps_host) == 0) {
    return apply_position(record, gone);
  }
  region_objects_.set(record.object, record.pose, record.bounds, record.shape, record.layer, NextHost::node, false);
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

void CdNodeRole::receive_confirmed(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    host_.confirm(frame_, words_confirmed_++, message.record<messages::ConfirmRecord>(i).persists);
  }
}

void CdNodeRole::receive_owners(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    new_map_.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  if (message.last()) {
    map_.assign(new_map_, static_cast<std::uint32_t>(setup_.peers.size()), message.header().epoch);
    interior_ = map_.interior(setup_.node);
    new_map_.clear();
    // After a change of the map every node receives everything in its region again: from the server, or from the hosts.
    region_objects_.clear();
    map_is_new_ = true;
    host_.list_all(stage_ == Stage::ending && node_contacts_->hosts_exchange_objects);
  }
}

}  // namespace ringfence::nodes
