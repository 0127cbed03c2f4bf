#include "nodes/cd_node_role.hpp"

#include <algorithm>
#include <cstring>
#include <new>
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

// What a batch changed goes to the server while the next one is moved: it is still in the cache here, and the server
// takes it in meanwhile. False where the link is full.
bool CdNodeRole::move() {
  TrackedTime time(setup_.track, "move", told_.move_ns);
  const messages::RunHead to_server = head(MessageType::node_state, Endpoint::server());
  const std::size_t bytes = sizeof(messages::NodeStateRecord) + host_.state_bytes();
  for (;;) {
    for (; told_changes_ != 0; ++next_changed_) {
      if (!tells_[next_changed_]) {
        continue;
      }
      std::byte* where = states_run_.add(*setup_.server.out, to_server, bytes, traffic_);
      if (where == nullptr) {
        return false;
      }
      tell_own_move(next_changed_, where);
      --told_changes_;
    }
    if (!host_.move_next()) {
      findings_->kept.finish();
      findings_->halo.finish(static_cast<NodeNumber>(setup_.peers.size()));
      return states_run_.finish(*setup_.server.out, to_server, bytes, traffic_);
    }
    changed_ = host_.changed();
    next_changed_ = 0;
    bound_batch();
    place_batch();
  }
}

void CdNodeRole::bound_batch() {
  geometry::PlacedShape placed[Host::batch];
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = host_[changed_[i]];
    placed[i] = {&object.pose, object.shape};
  }
  setup_.shapes->bounds({placed, changed_.size()}, *setup_.space, changed_bounds_.data(), changed_points_.data());
}

// Apart from the bounding: what is read again as a whole right after it was written in parts stalls the processor.
void CdNodeRole::place_batch() {
  if (publishes_) {
    note_cells();
  }
  constexpr std::size_t ahead = 12;
  const auto fetch = [&](std::size_t i) {
    if (i < changed_.size()) {
      known_.fetch(host_.place_in_list(changed_[i]));
    }
  };
  for (std::size_t i = 0; i < ahead; ++i) {
    fetch(i);
  }
  told_changes_ = 0;
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    fetch(i + ahead);
    if (host_.differs()[i]) {
      place(i);
    } else {
      rest(i);
    }
    told_changes_ += tells_[i] ? 1 : 0;
  }
}

// What rests, and is only told because it does, stands in the cell that was noted before.
void CdNodeRole::note_cells() {
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    host_.set_cell(changed_[i], relay_cell(host_[changed_[i]], changed_points_[i].at));
  }
}

// The i-th of the batch is where it was. The server is told if its state has been kept from it so far; else it is
// listed because under a new map nobody knows it yet.
void CdNodeRole::rest(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t was = known_.find(object.object.slot, host_.place_in_list(hosted));
  bool inner = was != KnownObjects::none && known_.inner(was);
  if (was == KnownObjects::none && (object.object.flags & messages::flag_present) != 0) {
    const regions::Cover cover = cover_of(bounds);
    inner = cover == regions::Cover::all;
    if (!inner) {
      tell_peers(object, bounds, true, was);
    }
    if (cover != regions::Cover::none) {
      host_.set_place_in_list(hosted, known_.set(object.object, object.pose, bounds, object.shape, object.layer,
                                                 NextHost::self, inner, was, hosted));
    }
  }
  tells_[i] = (object.object.flags & messages::flag_kept) != 0;
  changed_flags_[i] =
      messages::flag_present | messages::flag_staying | messages::flag_rests | (inner ? messages::flag_inner : 0u);
  host_.keep(hosted, false);
}

regions::Cover CdNodeRole::cover_of(const geometry::Bounds& bounds) const noexcept {
  return geometry::holds(interior_, bounds) ? regions::Cover::all : map_.cover(bounds, setup_.node);
}

// Where the i-th of the batch stands by the map as it is, and whether anybody need be told.
void CdNodeRole::place(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t* const point = changed_points_[i].at;
  const bool present = (object.object.flags & messages::flag_present) != 0;
  const bool was_kept = (object.object.flags & messages::flag_kept) != 0;
  const regions::Cover cover = present ? cover_of(bounds) : regions::Cover::none;
  const bool inner = cover == regions::Cover::all;
  const bool within = geometry::holds(bounds, point);
  // Most stand within their bounds, and those within the region: then nobody need look whose cell it is.
  const NodeNumber next = inner && within ? setup_.node : map_.owner_at(point);
  const bool staying = next == setup_.node;
  const std::uint32_t was = known_.find(object.object.slot, host_.place_in_list(hosted));
  if (was_kept && !(inner && (was == KnownObjects::none || known_.inner(was)))) {
    tell_peers(object, bounds, staying, was);
  }
  if (cover != regions::Cover::none) {
    const std::uint32_t known = known_.set(object.object, object.pose, bounds, object.shape, object.layer,
                                           staying ? NextHost::self : NextHost::node, inner, was, hosted);
    host_.set_place_in_list(hosted, known);
  } else {
    known_.forget(object.object.slot);
  }
  if (!staying) {
    movers_.push_back({object.object.number, next});
  }
  // Where it stands within its bounds, its next host is told of it, too, and knows by them who else was.
  const bool keeps = keeps_ && present && ((inner && staying) || within);
  tells_[i] = !keeps || !staying || !was_kept;
  told_.kept += tells_[i] ? 0 : 1;
  if (!tells_[i] && setup_.may_be_lost) {
    findings_->kept.add(frame_, object.object, object.pose, host_.state(hosted));
  }
  changed_flags_[i] = (present ? messages::flag_present : 0u) | (inner ? messages::flag_inner : 0u) |
                      (staying ? messages::flag_staying : 0u) | (keeps ? messages::flag_kept : 0u);
  host_.keep(hosted, keeps);
}

// The server tells a node of every object in its region but those that the node itself hosts and reported.
void CdNodeRole::tell_own_move(std::size_t i, std::byte* where) {
  const Hosted& object = host_[changed_[i]];
  auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, changed_bounds_[i]};
  record->object.flags = changed_flags_[i];
  if (host_.state_bytes() != 0) {
    std::memcpy(where + sizeof *record, host_.state(changed_[i]), host_.state_bytes());
  }
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

std::uint32_t CdNodeRole::relay_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept {
  return (object.object.flags & messages::flag_present) != 0 ? setup_.interest_grid.cell_of(point) : Host::unpublished;
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
