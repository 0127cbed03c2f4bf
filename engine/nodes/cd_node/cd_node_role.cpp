#include "nodes/cd_node/cd_node_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::SpanTimer;

CdNodeRole::CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map)
    : setup_(setup),
      self_(Endpoint::node(setup.node)),
      map_(map),
      interior_(map.interior(setup.node)),
      fault_(setup.faults),
      host_(setup.model, setup.objects, &fault_),
      region_objects_(setup.objects, setup.placement == Placement::region),
      sweep_(setup.placement == Placement::region ? setup.objects : 0,
             setup.placement == Placement::region ? setup.pairs : 0, setup.layer_masks, setup.keep_resting),
      narrow_(*setup.shapes),
      hand_overs_received_from_(setup.peers.size()),
      lost_(setup.peers.size()),
      node_contacts_(setup.server.node_contacts != nullptr ? setup.server.node_contacts : &own_contacts_),
      leaving_numbers_(setup.peers.size()),
      hand_over_runs_(setup.peers.size()) {
  pairs_.reserve(pairs_per_test);
  new_map_.reserve(map.grid().cells());
  kinds_.reserve(shape_kinds * shape_kinds);
  hits_.reserve(setup.objects);
  touches_.reserve(setup.objects);
  order_.reserve(setup.objects);
  node_contacts_->for_peers.reserve(setup.objects);
  output_merge_scratch_.reserve(setup.objects);
  narrow_.remember_axes(setup.remember_axes);
  leaving_objects_.reserve(setup.objects);
  host_.reserve_contacts(setup.objects);
  node_contacts_->host = &host_;
  if (shares_states()) {
    node_contacts_->ghost_updates.reserve(setup.objects / 8 + 64);  // few objects touch another region
    ghosts_.reserve(setup.objects / 8 + 64);
  }
  if (shares_states() && setup.may_be_lost) {
    node_contacts_->host_states.reserve(setup.objects, host_.state_bytes());
  }
}

// Whether the server can read this node's states in shared memory, so that messages need not contain them.
bool CdNodeRole::shares_states() const noexcept {
  return setup_.server.node_contacts != nullptr && setup_.placement == Placement::region &&
         setup_.keeps_host_owned_states;
}

messages::RunHeader CdNodeRole::head(MessageType type, Endpoint to) const noexcept {
  return {type, self_, to, frame_, map_.epoch()};
}

void CdNodeRole::assign(NodeNumber node, const std::vector<Connection>& peers) {
  setup_.node = node;
  self_ = Endpoint::node(node);
  setup_.peers = peers;
  hand_overs_received_from_.resize(peers.size());
  lost_.assign(peers.size(), 0);
  leaving_numbers_.resize(peers.size());
  hand_over_runs_.resize(peers.size());
  stamps_.assign(peers.size(), 0);
  interior_ = map_.interior(node);
  const auto count = static_cast<std::uint32_t>(peers.size());
  map_fits_ = map_.nodes() <= count || regions::RegionMap::is_table(map_.table(), map_.grid(), count);
  keeps_host_owned_ = shares_states() && std::all_of(peers.begin(), peers.end(), [](const Connection& peer) {
                        return peer.out == nullptr || peer.node_contacts != nullptr;
                      });
  for (auto& leavers : leaving_numbers_) {
    leavers.reserve(setup_.objects / peers.size() + 16);
  }
}

Step CdNodeRole::step() {
  step_start_ = telemetry::now_ns();
  if (fault_.is_stopped(step_start_)) [[unlikely]] {
    return Step::idle;
  }
  bool progressed = receive_from(setup_.server);
  progressed |= receive_from_peers();
  progressed |= answer_probe();
  while (advance()) {
    progressed = true;
  }
  if (progressed) {
    frame_stats_.busy_ns += telemetry::now_ns() - step_start_;
    return Step::progressed;
  }
  const bool sending = stage_ == Stage::moving || stage_ == Stage::colliding || stage_ == Stage::handing_over ||
                       stage_ == Stage::reporting;
  return sending ? Step::blocked : Step::idle;
}

void CdNodeRole::begin(std::uint64_t frame) {
  frame_ = frame;
  positions_received_ = contacts_received_ = frame_end_received_ = false;
  pairs_received_ = setup_.placement == Placement::region;
  hand_overs_received_ = 0;
  new_map_.clear();
  discard_tests();
  std::fill(hand_overs_received_from_.begin(), hand_overs_received_from_.end(), 0);
  std::fill(lost_.begin(), lost_.end(), 0);
  host_.begin_contacts(frame);
  frame_stats_ = {};
  cpu_start_ = telemetry::thread_cpu_ns();
  leaving_objects_.clear();
  changed_ = {};
  next_changed_ = reported_changes_ = 0;
  states_run_.start();
  const bool published =
      std::exchange(publishes_, setup_.server.publication != nullptr && setup_.server.publication->wanted);
  if (publishes_ && !published) {
    host_.forget_cells();  // the cells were not updated while nothing was published
  }
  {
    SpanTimer time(setup_.track, "move", frame_stats_.move_ns);
    host_.begin_move(frame);
    node_contacts_->host_states.begin(frame);
    node_contacts_->ghost_updates.start(frame);
  }
  stage_ = Stage::moving;
}

// Whether the current map makes this node the host of objects at `position`.
bool CdNodeRole::is_in_own_region(const Vec3d& position) const noexcept {
  if (map_.sole_owner() == setup_.node) {
    return true;
  }
  std::uint32_t point[3];
  setup_.space->point(position, point);
  return map_.owner_at(point) == setup_.node;
}

// Publishes the hosted objects for the user nodes, while the server receives the states of the other nodes. The poses
// are final, because they have been reported.
void CdNodeRole::publish() {
  if (!publishes_) {
    return;
  }
  std::uint64_t publish_ns = 0;
  SpanTimer time(setup_.track, "publish", publish_ns);
  link::Publication& publication = setup_.server.publication->publication;
  publication.begin(frame_);
  publication.add_table(static_cast<std::uint32_t>(host_.size()), [this](std::uint32_t i) {
    if (host_.cell(i) == Host::unplaced) [[unlikely]] {
      std::uint32_t point[3];
      setup_.space->point(host_[i].pose.position, point);
      host_.set_cell(i, relay_cell(host_[i], point));
    }
    return host_.cell(i);
  });
  fault_.pass(NodeStage::publication, frame_);
  publication.publish_indexed(
      [this](std::uint32_t i) {
        base::prefetch_for_read(&host_[i]);
        base::prefetch_for_read(reinterpret_cast<const std::byte*>(&host_[i] + 1) - 1);
      },
      [this](std::uint32_t i) {
        return link::PublishedState{host_[i].object.number, 0, host_[i].pose};
      });
  note_cell_range(setup_.server.publication->published, frame_);
  published_run_.start(0);
}

bool CdNodeRole::send_published() {
  return published_run_.pump(*setup_.server.out, head(MessageType::published, Endpoint::server()), 0, traffic_,
                             [](std::size_t, std::byte*) {});
}

// CPU time in this frame so far.
std::uint64_t CdNodeRole::cpu_spent() const noexcept {
  return setup_.shares_thread ? frame_stats_.busy_ns + (telemetry::now_ns() - step_start_)
                              : telemetry::thread_cpu_ns() - cpu_start_;
}

bool CdNodeRole::send_frame_done() {
  return frame_done_run_.pump(*setup_.server.out, head(MessageType::frame_done, Endpoint::server()),
                              sizeof(messages::NodeFrameStats), traffic_, [&](std::size_t, std::byte* where) {
                                frame_stats_.cpu_ns = cpu_spent();
                                frame_stats_.busy_ns += telemetry::now_ns() - step_start_;
                                frame_stats_.hosted = host_.size();
                                const HostRefusals& refusals = host_.refusals();
                                frame_stats_.model_failed = refusals.model_failed;
                                frame_stats_.not_finite = refusals.not_finite;
                                frame_stats_.not_unit = refusals.not_unit;
                                const TrafficReport& m5 = traffic_[static_cast<std::size_t>(Traffic::m5)];
                                frame_stats_.m5_messages = m5.messages;
                                frame_stats_.m5_bytes = m5.bytes;
                                std::memcpy(where, &frame_stats_, sizeof frame_stats_);
                              });
}

// Does the work of one stage and enters the next. Returns false if the role has to wait.
bool CdNodeRole::advance() {
  if (fails_here()) [[unlikely]] {
    return false;
  }
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::moving:
      if (!states_run_.done()) {
        if (!move()) {
          return false;
        }
        frame_stats_.move_cpu_ns = cpu_spent();
        publish();
      }
      if (!send_published()) {
        return false;
      }
      frame_stats_.publish_cpu_ns = cpu_spent() - frame_stats_.move_cpu_ns;
      stage_ = Stage::gathering;
      return true;
    case Stage::gathering:
      if (!positions_received_ || !pairs_received_) {
        return false;
      }
      receive_ghosts();
      detect();
      stage_ = Stage::colliding;
      return true;
    case Stage::colliding:
      if (!send_collisions()) {
        return false;
      }
      frame_stats_.detect_cpu_ns = cpu_spent() - frame_stats_.move_cpu_ns - frame_stats_.publish_cpu_ns;
      stage_ = Stage::ending;
      return true;
    case Stage::ending:
      if (!contacts_received_ || !frame_end_received_) {
        return false;
      }
      finish_contacts();
      list_leaving_objects();
      stage_ = Stage::handing_over;
      return true;
    case Stage::handing_over:
      if (!send_hand_overs()) {
        return false;
      }
      stage_ = Stage::settling;
      return true;
    case Stage::settling:
      if (hand_overs_received_ < hand_overs_expected_) {
        return false;
      }
      kinds_run_.start(kinds_.size());
      frame_done_run_.start(1);
      stage_ = Stage::reporting;
      return true;
    case Stage::reporting:
      if (!send_kinds() || !send_frame_done()) {
        return false;
      }
      traffic_ = {};
      stage_ = Stage::waiting;
      return true;
  }
  return false;
}

}  // namespace ringfence::nodes
