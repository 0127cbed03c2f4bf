// Hand-over of what a CD node hosts, and what it does when a peer is lost.
#include <cassert>
#include <cstring>
#include <utility>

#include "nodes/cd_node_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

// Who hosts what in the next frame follows from the poses and the region map, so the server expects the same.
void CdNodeRole::list_leavers() {
  for (auto& leavers : leavers_) {
    leavers.clear();
  }
  if (std::exchange(map_is_new_, false)) {
    for (std::size_t i = 0; i < host_.size(); ++i) {
      std::uint32_t point[3];
      setup_.space->point(host_[i].pose.position, point);
      const NodeNumber next = map_.owner_at(point);
      if (next != setup_.node) {
        leavers_[next].push_back(host_[i].object.number);
      }
    }
  } else {
    for (const Mover& mover : movers_) {
      host_.fetch_index(mover.number);
    }
    for (const Mover& mover : movers_) {
      host_.fetch_leaver(mover.number);
    }
    for (const Mover& mover : movers_) {
      assert(host_.find(mover.number) != NumberIndex::none);  // not dropped or given away since it moved
      leavers_[mover.next].push_back(mover.number);
    }
  }
  for (std::size_t peer = 0; peer < leavers_.size(); ++peer) {
    if (lost_[peer] != 0) {
      drop_leavers(peer);
    } else if (!leavers_[peer].empty()) {
      hand_over_runs_[peer].start(leavers_[peer].size());
    }
  }
}

bool CdNodeRole::send_hand_overs() {
  bool all = true;
  for (NodeNumber peer = 0; peer < leavers_.size(); ++peer) {
    if (hand_over_runs_[peer].done()) {
      continue;
    }
    const auto& leavers = leavers_[peer];
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
                                        ++told_.handed_over;
                                      });
  }
  return all;
}

void CdNodeRole::drop_leavers(std::size_t peer) {
  for (const ObjectNumber number : leavers_[peer]) {
    host_.drop(number);
  }
  leavers_[peer].clear();
  hand_over_runs_[peer].stop();
}

// Whether the fault that was ordered is due: then the role does nothing more, or not for a while.
bool CdNodeRole::fails_here() noexcept {
  static_assert(static_cast<int>(Stage::telling) == static_cast<int>(NodeStage::telling) + 1);
  if (stage_ == Stage::waiting || frame_ != fault_->frame ||
      static_cast<int>(stage_) != static_cast<int>(fault_->stage) + 1) {
    return false;
  }
  const auto stall = static_cast<std::uint64_t>(fault_->stall_ms * 1e6);
  failed_until_ns_ = stall == 0 ? ~std::uint64_t{0} : telemetry::now_ns() + stall;
  fault_.reset();
  return true;
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
  return here_run_.pump(*setup_.server.out, head(MessageType::here, Endpoint::server()), 0, traffic_,
                        [](std::size_t, std::byte*) {});
}

// A peer has stopped answering. Either the frame is detected anew, under a map that follows; or its contacts are known,
// and what was to pass between the two passes through the server's hands.
void CdNodeRole::hear_lost(const messages::LostRecord& record) {
  if (stage_ == Stage::waiting && record.again == 0) {
    return;  // it has told all, so that nothing is open between the two; and the number may be somebody else's by now
  }
  lost_[record.node] = 1;
  if (record.again != 0) {
    new_map_.clear();
    forget_tests();
    if (stage_ != Stage::waiting) {
      host_.begin_contacts(frame_);
    }
    positions_heard_ = false;
    pairs_heard_ = setup_.placement == Placement::region;
    if (stage_ == Stage::colliding || stage_ == Stage::ending) {
      collisions_run_.start();
      stage_ = Stage::gathering;
    }
    return;
  }
  hand_overs_expected_ -= record.hand_overs;
  hand_overs_heard_ -= heard_from_[record.node];
  heard_from_[record.node] = 0;
  if (stage_ == Stage::handing_over) {
    drop_leavers(record.node);
  }
}

void CdNodeRole::forget_tests() {
  pairs_.clear();
  hits_.clear();
  touches_.clear();
  order_.clear();
  candidates_ = 0;
  narrow_.reset_counters();
}

}  // namespace ringfence::nodes
