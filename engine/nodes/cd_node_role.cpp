#include "nodes/cd_node_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/fetch.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::TrackedTime;

CdNodeRole::CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map)
    : setup_(setup),
      self_(Endpoint::node(setup.node)),
      map_(map),
      interior_(map.interior(setup.node)),
      host_(setup.model, setup.objects),
      known_(setup.objects, setup.placement == Placement::region),
      sweep_(setup.placement == Placement::region ? setup.objects : 0,
             setup.placement == Placement::region ? setup.pairs : 0, setup.layer_masks, setup.keep_resting),
      narrow_(*setup.shapes),
      heard_from_(setup.peers.size()),
      lost_(setup.peers.size()),
      findings_(setup.server.findings != nullptr ? setup.server.findings : &own_findings_),
      leavers_(setup.peers.size()),
      hand_over_runs_(setup.peers.size()) {
  pairs_.reserve(pairs_a_test);
  new_map_.reserve(map.grid().cells());
  kinds_.reserve(shape_kinds * shape_kinds);
  hits_.reserve(setup.objects);
  touches_.reserve(setup.objects);
  order_.reserve(setup.objects);
  findings_->for_peers.reserve(setup.objects);
  listing_scratch_.reserve(setup.objects);
  narrow_.remember_axes(setup.remember_axes);
  movers_.reserve(setup.objects);
  host_.reserve_contacts(setup.objects);
  findings_->host = &host_;
  if (shares_states()) {
    findings_->halo.reserve(setup.objects / 8 + 64);  // few touch another's region
    heard_.reserve(setup.objects / 8 + 64);
  }
  if (shares_states() && setup.may_be_lost) {
    findings_->kept.reserve(setup.objects, host_.state_bytes());
  }
}

// Whether it can, as far as the server is concerned.
bool CdNodeRole::shares_states() const noexcept {
  return setup_.server.findings != nullptr && setup_.placement == Placement::region && setup_.keeps_states;
}

messages::RunHead CdNodeRole::head(MessageType type, Endpoint to) const noexcept {
  return {type, self_, to, frame_, map_.epoch()};
}

void CdNodeRole::meet(NodeNumber node, const std::vector<Line>& peers) {
  setup_.node = node;
  self_ = Endpoint::node(node);
  setup_.peers = peers;
  heard_from_.resize(peers.size());
  lost_.assign(peers.size(), 0);
  leavers_.resize(peers.size());
  hand_over_runs_.resize(peers.size());
  stamps_.assign(peers.size(), 0);
  interior_ = map_.interior(node);
  keeps_ = shares_states() && std::all_of(peers.begin(), peers.end(), [](const Line& peer) {
             return peer.out == nullptr || peer.findings != nullptr;
           });
  for (auto& leavers : leavers_) {
    leavers.reserve(setup_.objects / peers.size() + 16);
  }
}

Step CdNodeRole::step() {
  step_start_ = telemetry::now_ns();
  if (failed_until_ns_ > step_start_) [[unlikely]] {
    return Step::idle;
  }
  bool progressed = listen(setup_.server);
  progressed |= listen_to_peers();
  progressed |= answer_probe();
  while (advance()) {
    progressed = true;
  }
  if (progressed) {
    told_.busy_ns += telemetry::now_ns() - step_start_;
    return Step::progressed;
  }
  const bool sending = stage_ == Stage::moving || stage_ == Stage::colliding || stage_ == Stage::handing_over ||
                       stage_ == Stage::telling;
  return sending ? Step::blocked : Step::idle;
}

void CdNodeRole::begin(std::uint64_t frame) {
  frame_ = frame;
  positions_heard_ = contacts_heard_ = end_heard_ = false;
  pairs_heard_ = setup_.placement == Placement::region;
  hand_overs_heard_ = 0;
  words_confirmed_ = 0;
  new_map_.clear();
  forget_tests();
  std::fill(heard_from_.begin(), heard_from_.end(), 0);
  std::fill(lost_.begin(), lost_.end(), 0);
  host_.begin_contacts(frame);
  told_ = {};
  cpu_start_ = telemetry::thread_cpu_ns();
  movers_.clear();
  changed_ = {};
  next_changed_ = told_changes_ = 0;
  states_run_.start();
  const bool published =
      std::exchange(publishes_, setup_.server.publication != nullptr && setup_.server.publication->wanted);
  if (publishes_ && !published) {
    host_.forget_cells();  // nobody noted them
  }
  {
    TrackedTime time(setup_.track, "move", told_.move_ns);
    host_.begin_move(frame);
    findings_->kept.begin(frame);
    findings_->halo.start(frame);
  }
  stage_ = Stage::moving;
}

// Whether this node hosts what stands there, by the map as it is.
bool CdNodeRole::is_at_home(const Vec3d& position) const noexcept {
  if (map_.nodes() == 1) {
    return true;
  }
  std::uint32_t point[3];
  setup_.space->point(position, point);
  return map_.owner_at(point) == setup_.node;
}

// The state relay, while the server takes in what others tell: poses are final once they have been told.
void CdNodeRole::publish() {
  if (!publishes_) {
    return;
  }
  std::uint64_t publish_ns = 0;
  TrackedTime time(setup_.track, "publish", publish_ns);
  link::Publication& publication = setup_.server.publication->publication;
  publication.begin(frame_);
  publication.list_table(static_cast<std::uint32_t>(host_.size()), [this](std::uint32_t i) {
    if (host_.cell(i) == Host::unplaced) [[unlikely]] {
      std::uint32_t point[3];
      setup_.space->point(host_[i].pose.position, point);
      host_.set_cell(i, relay_cell(host_[i], point));
    }
    return host_.cell(i);
  });
  publication.publish_listed(
      [this](std::uint32_t i) {
        fetch_to_read(&host_[i]);
        fetch_to_read(reinterpret_cast<const std::byte*>(&host_[i] + 1) - 1);
      },
      [this](std::uint32_t i) {
        return link::PublishedState{host_[i].object.number, 0, host_[i].pose};
      });
  note_reach(setup_.server.publication->published, frame_);
  published_run_.start(0);
}

bool CdNodeRole::send_published() {
  return published_run_.pump(*setup_.server.out, head(MessageType::published, Endpoint::server()), 0, traffic_,
                             [](std::size_t, std::byte*) {});
}

// In this frame so far.
std::uint64_t CdNodeRole::cpu_spent() const noexcept {
  return setup_.shares_thread ? told_.busy_ns + (telemetry::now_ns() - step_start_)
                              : telemetry::thread_cpu_ns() - cpu_start_;
}

bool CdNodeRole::send_told() {
  return told_run_.pump(*setup_.server.out, head(MessageType::told, Endpoint::server()), sizeof(messages::ToldRecord),
                        traffic_, [&](std::size_t, std::byte* where) {
                          told_.cpu_ns = cpu_spent();
                          told_.busy_ns += telemetry::now_ns() - step_start_;
                          told_.hosted = host_.size();
                          const HostRefusals& refusals = host_.refusals();
                          told_.model_failed = refusals.model_failed;
                          told_.not_finite = refusals.not_finite;
                          told_.not_unit = refusals.not_unit;
                          const TrafficReport& m5 = traffic_[static_cast<std::size_t>(Traffic::m5)];
                          told_.m5_messages = m5.messages;
                          told_.m5_bytes = m5.bytes;
                          std::memcpy(where, &told_, sizeof told_);
                        });
}

// One transition of the frame; false where it has to wait.
bool CdNodeRole::advance() {
  if (fault_ && fails_here()) [[unlikely]] {
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
        told_.move_cpu_ns = cpu_spent();
        publish();
      }
      if (!send_published()) {
        return false;
      }
      told_.publish_cpu_ns = cpu_spent() - told_.move_cpu_ns;
      stage_ = Stage::gathering;
      return true;
    case Stage::gathering:
      if (!positions_heard_ || !pairs_heard_) {
        return false;
      }
      hear_peers();
      detect();
      stage_ = Stage::colliding;
      return true;
    case Stage::colliding:
      if (!send_collisions()) {
        return false;
      }
      told_.detect_cpu_ns = cpu_spent() - told_.move_cpu_ns - told_.publish_cpu_ns;
      stage_ = Stage::ending;
      return true;
    case Stage::ending:
      if (!contacts_heard_ || !end_heard_) {
        return false;
      }
      finish_contacts();
      list_leavers();
      stage_ = Stage::handing_over;
      return true;
    case Stage::handing_over:
      if (!send_hand_overs()) {
        return false;
      }
      stage_ = Stage::settling;
      return true;
    case Stage::settling:
      if (hand_overs_heard_ < hand_overs_expected_) {
        return false;
      }
      kinds_run_.start(kinds_.size());
      told_run_.start(1);
      stage_ = Stage::telling;
      return true;
    case Stage::telling:
      if (!send_kinds() || !send_told()) {
        return false;
      }
      traffic_ = {};
      stage_ = Stage::waiting;
      return true;
  }
  return false;
}

}  // namespace ringfence::nodes
