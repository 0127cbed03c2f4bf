#include "nodes/cd_node_role.hpp"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <new>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;
using telemetry::TrackedTime;

CdNodeRole::CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map)
    : setup_(setup),
      self_(Endpoint::node(setup.node)),
      map_(map),
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
  order_.reserve(setup.objects);
  narrow_.remember_axes(setup.remember_axes);
  movers_.reserve(setup.objects);
  host_.reserve_contacts(setup.objects);
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
  for (Line& peer : setup_.peers) {
    if (peer.in != nullptr) {
      progressed |= listen(peer);
    }
  }
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

bool CdNodeRole::listen(Line& line) {
  return drain(*line.in, host_.state_bytes(), [this](const MessageView& message) { receive(message); });
}

void CdNodeRole::receive(const MessageView& message) {
  switch (message.type()) {
    case MessageType::hand_over: {
      const NodeNumber from = Endpoint{message.header().source}.number();
      if (lost_[from] != 0) {
        return;  // the server has taken its objects back
      }
      heard_from_[from] += message.count();
      hand_overs_heard_ += message.count();
      host_.hear(message);
      return;
    }
    case MessageType::frame_begin:
      return begin(message.header().frame);
    case MessageType::position_update:
      return hear_positions(message);
    case MessageType::pairs:
      return hear_pairs(message);
    case MessageType::confirm:
      return hear_confirmed(message);
    case MessageType::notify:
      return hear_contacts(message);
    case MessageType::region_map:
      return hear_owners(message);
    case MessageType::lost:
      for (std::size_t i = 0; i < message.count(); ++i) {
        hear_lost(message.record<messages::LostRecord>(i));
      }
      return;
    case MessageType::probe:
      return here_run_.start(0);
    case MessageType::frame_end:
      hand_overs_expected_ = message.record<messages::FrameEndRecord>(0).hand_overs;
      end_heard_ = true;
      return;
    default:
      host_.hear(message);
  }
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
  next_changed_ = 0;
  states_run_.start();
  {
    TrackedTime time(setup_.track, "move", told_.move_ns);
    host_.begin_move(frame);
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
    for (; next_changed_ < changed_.size(); ++next_changed_) {
      std::byte* where = states_run_.add(*setup_.server.out, to_server, bytes, traffic_);
      if (where == nullptr) {
        return false;
      }
      tell_own_move(next_changed_, where);
    }
    if (!host_.move_next()) {
      return states_run_.finish(*setup_.server.out, to_server, bytes, traffic_);
    }
    changed_ = host_.changed();
    next_changed_ = 0;
    bound_batch();
  }
}

// Apart from the telling: what is read again as a whole right after it was written in parts stalls the processor.
void CdNodeRole::bound_batch() {
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = host_[changed_[i]];
    changed_bounds_[i] = setup_.shapes->bounds(object.shape, object.pose, *setup_.space);
    known_.fetch(object.object.slot);
  }
}

// The server tells a node of every object in its region but those that the node itself hosts and reported.
void CdNodeRole::tell_own_move(std::size_t i, std::byte* where) {
  const Hosted& object = host_[changed_[i]];
  const geometry::Bounds& bounds = changed_bounds_[i];
  const bool present = (object.object.flags & messages::flag_present) != 0;
  const bool staying = is_at_home(object.pose.position);
  const regions::Cover cover = map_.cover(bounds, setup_.node);
  std::uint32_t flags = object.object.flags;
  if (present && cover != regions::Cover::none) {
    flags |= cover == regions::Cover::all ? messages::flag_inner : 0u;
    known_.set(object.object, object.pose, bounds, object.shape, object.layer, staying);
  } else {
    known_.forget(object.object.slot);
  }
  if (staying) {
    flags |= messages::flag_staying;
  } else {
    movers_.push_back(object.object.number);
  }
  auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, bounds};
  record->object.flags = flags;
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

void CdNodeRole::hear_positions(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    if ((record.object.flags & messages::flag_gone) != 0) {
      known_.forget(record.object.slot);
    } else {
      const bool staying =
          setup_.hosts && host_.find(record.object.number) != NumberIndex::none && is_at_home(record.pose.position);
      known_.set(record.object, record.pose, record.bounds, record.shape, record.layer, staying);
    }
  }
  positions_heard_ |= message.last();
}

void CdNodeRole::hear_pairs(const MessageView& message) {
  const auto bodies = known_.bodies();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& pair = message.view<messages::PairRecord>(i);
    const geometry::CandidatePair known{known_.find(pair.a), known_.find(pair.b)};
    assert(known.a != KnownObjects::none && known.b != KnownObjects::none);
    __builtin_prefetch(&bodies[known.a]);
    __builtin_prefetch(&bodies[known.b]);
    pairs_.push_back(known);
    if (pairs_.size() == pairs_a_test) {
      test_pairs();
    }
  }
  pairs_heard_ |= message.last();
}

void CdNodeRole::hear_contacts(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    // Between frames these are the last contacts of an object that was taken over.
    if (stage_ == Stage::waiting) {
      host_.add_late_contact(message.record<Contact>(i));
    } else {
      host_.add_contact(frame_, message.record<Contact>(i));
    }
  }
  contacts_heard_ |= message.last() && stage_ != Stage::waiting;
}

void CdNodeRole::hear_confirmed(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    host_.confirm(frame_, words_confirmed_++, message.record<messages::ConfirmRecord>(i).persists);
  }
}

void CdNodeRole::hear_owners(const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    new_map_.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  if (message.last()) {
    map_.assign(new_map_, static_cast<std::uint32_t>(setup_.peers.size()), message.header().epoch);
    new_map_.clear();
    // Under a new map the server tells everyone of everything in its region anew.
    known_.clear();
    map_is_new_ = true;
  }
}

void CdNodeRole::sweep() {
  const auto bounds = known_.bounds();
  const auto bodies = known_.bodies();
  {
    TrackedTime time(setup_.track, "broad phase", told_.broad_phase_ns);
    sweep_.begin(bounds, known_.present(), known_.resting(), known_.layers());
  }
  bool more = true;
  while (more) {
    {
      TrackedTime time(setup_.track, "broad phase", told_.broad_phase_ns);
      while (more && pairs_.size() < pairs_a_test) {
        const auto found = sweep_.next(pairs_a_test - pairs_.size());
        more = !found.empty();
        for (geometry::CandidatePair pair : found) {
          if (map_.pair_owner(bounds[pair.a], bounds[pair.b]) != setup_.node) {
            continue;
          }
          if (bodies[pair.b].number < bodies[pair.a].number) {
            std::swap(pair.a, pair.b);
          }
          pairs_.push_back(pair);
        }
      }
    }
    test_pairs();
  }
  known_.settle();
}

// As many pairs as make full blocks of every kind, and whose objects stay in the cache from the sort to the kernels.
void CdNodeRole::test_pairs() {
  if (pairs_.empty()) {
    return;
  }
  TrackedTime time(setup_.track, "narrow phase", told_.narrow_phase_ns);
  for (const narrow_phase::PairContact& found : narrow_.test(known_.bodies(), pairs_)) {
    add_hit(pairs_[found.pair], found);
  }
  candidates_ += pairs_.size();
  pairs_.clear();
}

// While both bodies are in the cache; in the order of numbers they lie anywhere.
void CdNodeRole::add_hit(const geometry::CandidatePair& pair, const narrow_phase::PairContact& found) {
  const narrow_phase::Body& a = known_.bodies()[pair.a];
  const narrow_phase::Body& b = known_.bodies()[pair.b];
  const Vec3d& origin = a.pose.position;
  order_.add(a.number, b.number);
  hits_.push_back({known_.slot(pair.a), known_.slot(pair.b), !known_.staying(pair.a) || !known_.staying(pair.b)});
  Contact& contact = host_.add_own_contact(frame_);
  contact.a = a.number;
  contact.b = b.number;
  contact.depth = found.depth;
  contact.normal = found.normal;
  contact.point = {origin.x + static_cast<double>(found.point.x), origin.y + static_cast<double>(found.point.y),
                   origin.z + static_cast<double>(found.point.z)};
  contact.pose_a = a.pose;
  contact.pose_b = b.pose;
}

void CdNodeRole::detect() {
  if (setup_.placement == Placement::region) {
    sweep();
  } else {
    test_pairs();
  }
  TrackedTime time(setup_.track, "narrow phase", told_.narrow_phase_ns);
  count_kinds();
  order_.sort();
  list_findings();
  next_hit_ = 0;
  collisions_run_.start();
  done_run_.start(1);
}

// Counted by the kernels themselves, so that "each pair once" is checked against what was done, not what was asked.
void CdNodeRole::count_kinds() {
  tested_ = 0;
  kinds_.clear();
  for (std::uint32_t p = 0; p < shape_kinds; ++p) {
    for (std::uint32_t q = p; q < shape_kinds; ++q) {
      const auto& counters = narrow_.counters(static_cast<ShapeKind>(p), static_cast<ShapeKind>(q));
      if (counters.candidates != 0) {
        messages::KindRecord& record = kinds_.emplace_back();
        record.first = p;
        record.second = q;
        record.candidates = counters.candidates;
        record.hits = counters.hits;
        record.lanes = counters.lanes;
        record.lanes_filled = counters.lanes_filled;
        record.iterations = counters.iterations;
        record.ended_early = counters.ended_early;
        record.timed = counters.timed;
        record.nanoseconds = counters.nanoseconds;
        record.gather_nanoseconds = counters.gather_nanoseconds;
        std::copy(std::begin(counters.cost), std::end(counters.cost), std::begin(record.cost));
        tested_ += counters.candidates;
      }
    }
  }
  narrow_.reset_counters();
}

// In order of (a, b), so that the server merges runs and the host's next move reads its contacts in it.
void CdNodeRole::list_findings() {
  Findings& findings = *findings_;
  findings.contacts = host_.own_contacts(frame_);
  findings.keys.resize(hits_.size());
  findings.found.resize(hits_.size());
  findings.outer.clear();
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    const std::uint32_t contact = order_.at(i);
    const std::uint64_t key = order_.key_at(i);
    const Hit& hit = hits_[contact];
    findings.keys[i] = key;
    findings.found[i] = {hit.slot_a, hit.slot_b, contact};
    if (hit.outer) {
      findings.outer.push_back(static_cast<std::uint32_t>(i));
    }
    if (setup_.hosts) {
      host_.order_own_contact(frame_, key, contact);
    }
  }
}

// To a server in another process; one in this process reads them where they lie.
bool CdNodeRole::send_collisions() {
  link::Sender& out = *setup_.server.out;
  const messages::RunHead to_server = head(MessageType::collision, Endpoint::server());
  const bool shared = findings_ != &own_findings_;
  for (; !shared && next_hit_ < hits_.size(); ++next_hit_) {
    std::byte* where = collisions_run_.add(out, to_server, sizeof(messages::CollisionRecord), traffic_);
    if (where == nullptr) {
      return false;
    }
    const FoundContact& found = own_findings_.found[next_hit_];
    const Contact& contact = own_findings_.contacts[found.contact];
    new (where) messages::CollisionRecord{found.slot_a, found.slot_b, contact.depth, contact.normal, contact.point};
  }
  return (shared || collisions_run_.finish(out, to_server, sizeof(messages::CollisionRecord), traffic_)) &&
         done_run_.pump(out, head(MessageType::narrow_done, Endpoint::server()), sizeof(messages::NarrowDoneRecord),
                        traffic_, [&](std::size_t, std::byte* where) {
                          const messages::NarrowDoneRecord record{candidates_, tested_, hits_.size()};
                          std::memcpy(where, &record, sizeof record);
                        });
}

// The phases of what was found, and the rest of its way to the embedder.
void CdNodeRole::hear_ranks() {
  if (findings_ == &own_findings_ || !setup_.hosts) {
    return;
  }
  findings_->write_rest(setup_.node, [&](std::uint32_t contact) { host_.confirm_begin(frame_, contact); });
}

bool CdNodeRole::send_kinds() {
  return kinds_run_.pump(*setup_.server.out, head(MessageType::kinds, Endpoint::server()), sizeof(messages::KindRecord),
                         traffic_,
                         [&](std::size_t i, std::byte* where) { std::memcpy(where, &kinds_[i], sizeof kinds_[i]); });
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
      if (!move()) {
        return false;
      }
      told_.move_cpu_ns = cpu_spent();
      stage_ = Stage::gathering;
      return true;
    case Stage::gathering:
      if (!positions_heard_ || !pairs_heard_) {
        return false;
      }
      detect();
      stage_ = Stage::colliding;
      return true;
    case Stage::colliding:
      if (!send_collisions()) {
        return false;
      }
      told_.detect_cpu_ns = cpu_spent() - told_.move_cpu_ns;
      stage_ = Stage::ending;
      return true;
    case Stage::ending:
      if (!contacts_heard_ || !end_heard_) {
        return false;
      }
      hear_ranks();
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
