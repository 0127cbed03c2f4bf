// Hand-over of hosted objects, and the reaction to the loss of a peer.
#include <cassert>
#include <cstring>
#include <utility>

#include "nodes/cd_node/cd_node_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

// The next hosts follow from the poses and the region map, so the server expects the same hand-overs.
void CdNodeRole::list_leaving_objects() {
  for (auto& leavers : leaving_numbers_) {
    leavers.clear();
  }
  if (std::exchange(map_is_new_, false)) {
    for (std::size_t i = 0; i < host_.size(); ++i) {
      std::uint32_t point[3];
      setup_.space->point(host_[i].pose.position, point);
      const NodeNumber next = map_.owner_at(point);
      if (next != setup_.node) {
        leaving_numbers_[next].push_back(host_[i].object.number);
      }
    }
  } else {
    for (const LeavingObject& mover : leaving_objects_) {
      host_.prefetch_index(mover.number);
    }
    for (const LeavingObject& mover : leaving_objects_) {
      host_.prefetch_leaver(mover.number);
    }
    for (const LeavingObject& mover : leaving_objects_) {
      assert(host_.find(mover.number) != base::NumberIndex::none);  // neither dropped nor handed over since it moved
      leaving_numbers_[mover.next].push_back(mover.number);
    }
  }
  for (std::size_t peer = 0; peer < leaving_numbers_.size(); ++peer) {
    if (lost_[peer] != 0) {
      drop_leaving_objects(peer);
    } else if (!leaving_numbers_[peer].empty()) {
      hand_over_runs_[peer].start(leaving_numbers_[peer].size());
    }
  }
}

bool CdNodeRole::send_hand_overs() {
  bool all = true;
  for (NodeNumber peer = 0; peer < leaving_numbers_.size(); ++peer) {
    if (hand_over_runs_[peer].done()) {
      continue;
    }
    fault_.pass(NodeStage::hand_over, frame_);
    const auto& leavers = leaving_numbers_[peer];
    all &= hand_over_runs_[peer].pump(*setup_.peers[peer].out, head(MessageType::hand_over, Endpoint::node(peer)),
                                      sizeof(messages::HandOverRecord) + host_.state_bytes(), traffic_,
                                      [&](std::size_t i, std::byte* where) {
                                        const std::uint32_t hosted = host_.find(leavers[i]);
                                        const messages::HandOverRecord record = host_.hand_over(hosted);
                                        std::memcpy(where, &record, sizeof record);
                                        if (host_.state_bytes() != 0) {
                                          std::memcpy(where + sizeof record, host_.state(hosted), host_.state_bytes());
                                        }
                                        host_.drop(leavers[i]);
                                        ++frame_stats_.handed_over;
                                      });
  }
  return all;
}

void CdNodeRole::drop_leaving_objects(std::size_t peer) {
  for (const ObjectNumber number : leaving_numbers_[peer]) {
    host_.drop(number);
  }
  leaving_numbers_[peer].clear();
  hand_over_runs_[peer].stop();
}

// Whether the injected fault is due: then the role stops, or stalls for a while.
bool CdNodeRole::fails_here() noexcept {
  static_assert(static_cast<int>(Stage::reporting) == static_cast<int>(NodeStage::reporting) + 1);
  return stage_ != Stage::waiting && fault_.stops_before(static_cast<NodeStage>(static_cast<int>(stage_) - 1), frame_);
}

bool CdNodeRole::answer_probe() {
  if (here_run_.done()) {
    return false;
  }
  if (stage_ == Stage::moving) {
    states_run_.flush(*setup_.server.out, head(MessageType::node_state, Endpoint::server()),
                      sizeof(messages::NodeStateRecord) + host_.state_bytes(), traffic_);
  } else if (stage_ == Stage::colliding) {
    collisions_run_.flush(*setup_.server.out, head(MessageType::collision, Endpoint::server()),
                          sizeof(messages::CollisionRecord), traffic_);
  }
  return here_run_.pump(*setup_.server.out, head(MessageType::probe_reply, Endpoint::server()), 0, traffic_,
                        [](std::size_t, std::byte*) {});
}

// A peer is lost. Either the frame is detected again, under a map that follows; or its contacts are known, and the
// server takes over the hand-overs between the two nodes.
void CdNodeRole::receive_lost(const messages::LostRecord& record) {
  if (stage_ == Stage::waiting && record.detect_again == 0) {
    // This node is done, so no hand-over is pending between the two, and the slot may already belong to another node.
    return;
  }
  lost_[record.node] = 1;
  if (record.detect_again != 0) {
    new_map_.clear();
    discard_tests();
    if (stage_ != Stage::waiting) {
      host_.begin_contacts(frame_);
    }
    positions_received_ = false;
    pairs_received_ = setup_.placement == Placement::region;
    if (stage_ == Stage::colliding || stage_ == Stage::ending) {
      collisions_run_.start();
      stage_ = Stage::gathering;
    }
    return;
  }
  hand_overs_expected_ -= record.hand_overs;
  hand_overs_received_ -= hand_overs_received_from_[record.node];
  hand_overs_received_from_[record.node] = 0;
  if (stage_ == Stage::handing_over) {
    drop_leaving_objects(record.node);
  }
}

void CdNodeRole::discard_tests() {
  pairs_.clear();
  hits_.clear();
  touches_.clear();
  order_.clear();
  candidates_ = 0;
  narrow_.reset_counters();
}

}  // namespace ringfence::nodes
