#include "nodes/cd_node/cd_node_role.hpp"

#include <utility>

#include "telemetry/clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::MessageType;
using messages::MessageView;

CdNodeRole::CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map)
    : state_(setup, map),
      exchange_(NodeExchange::make(state_)),
      halo_(state_),
      migration_(state_, *exchange_),
      mover_(state_, *exchange_, halo_, migration_),
      detector_(state_),
      publisher_(state_, detector_, *exchange_),
      answerer_(state_),
      expected_(state_, *exchange_, migration_) {}

void CdNodeRole::assign(NodeNumber node, const std::vector<Connection>& peers) {
  state_.assign(node, peers);
  inbox_.assign(peers);
  settle();
}

void CdNodeRole::assign(NodeNumber node, std::shared_ptr<const SharedNodes> nodes) {
  state_.assign(node, std::move(nodes));
  settle();
}

void CdNodeRole::settle() {
  exchange_->assign();
  halo_.assign();
  migration_.assign();
}

Step CdNodeRole::step() {
  const Step made = step_once();
  exchange_->finish_step();
  return made;
}

Step CdNodeRole::step_once() {
  step_start_ = telemetry::now_ns();
  if (state_.fault.is_stopped(step_start_)) [[unlikely]] {
    return Step::idle;
  }
  const FrameControl::Announced announced = exchange_->announced();
  bool progressed = receive_from_server();
  progressed |= follow(announced);
  progressed |= receive_from_peers();
  progressed |= answer_probe();
  while (advance()) {
    progressed = true;
  }
  // A part of them in each step, so that the node answers probes meanwhile.
  if (answerer_.is_pending()) [[unlikely]] {
    answerer_.answer_some();
    progressed = true;
  }
  if (progressed) {
    state_.stats.busy_ns += telemetry::now_ns() - step_start_;
    return Step::progressed;
  }
  const CdNodeStage stage = state_.stage;
  const bool sending = stage == CdNodeStage::moving || stage == CdNodeStage::gathering ||
                       stage == CdNodeStage::colliding || stage == CdNodeStage::handing_over ||
                       stage == CdNodeStage::reporting;
  return sending ? Step::blocked : Step::idle;
}

// Does the work of one stage and enters the next. Returns false if the role has to wait.
bool CdNodeRole::advance() {
  if (stops_here()) [[unlikely]] {
    return false;
  }
  switch (state_.stage) {
    case CdNodeStage::waiting:
      return false;
    case CdNodeStage::moving:
      if (!mover_.done()) {
        if (!mover_.move()) {
          return false;
        }
        state_.stats.move_cpu_ns = cpu_spent();
        mover_.publish();
      }
      state_.stats.publish_cpu_ns = cpu_spent() - state_.stats.move_cpu_ns;
      wait_start_ = state_.stats.publish_cpu_ns + state_.stats.move_cpu_ns;
      state_.stage = CdNodeStage::gathering;
      return true;
    case CdNodeStage::gathering:
      if (!exchange_->send_ghosts() || !state_.received.positions || !state_.received.pairs ||
          !exchange_->receive_ghosts(halo_)) {
        return false;
      }
      detect();
      state_.stage = CdNodeStage::colliding;
      return true;
    case CdNodeStage::colliding:
      if (!publisher_.send()) {
        return false;
      }
      wait_start_ = cpu_spent();
      state_.stats.detect_cpu_ns = wait_start_ - state_.stats.move_cpu_ns - state_.stats.publish_cpu_ns;
      // Here the node would wait for the other nodes. The next message may be a new map, which clears its objects.
      if (!state_.contacts.queries.queries.empty()) [[unlikely]] {
        answerer_.begin();
      }
      state_.stage = CdNodeStage::ending;
      return true;
    case CdNodeStage::ending:
      if (!state_.received.frame_end || answerer_.is_pending()) {
        return false;
      }
      publisher_.finish();
      migration_.start();
      state_.stage = CdNodeStage::handing_over;
      return true;
    case CdNodeStage::handing_over:
      if (!exchange_->send_to_peers() || !migration_.send()) {
        return false;
      }
      state_.stage = CdNodeStage::settling;
      return true;
    case CdNodeStage::settling:
      migration_.receive_listed();
      if (!migration_.is_complete() || !exchange_->complete_contacts()) {
        return false;
      }
      state_.stage = CdNodeStage::reporting;
      return true;
    case CdNodeStage::reporting:
      if (!exchange_->send_hits() || !report_done()) {
        return false;
      }
      state_.traffic = {};
      state_.stage = CdNodeStage::waiting;
      ++frames_;
      return true;
  }
  return false;
}

// What the server has announced before the messages were read that belong to it. After a loss the frame is detected
// again under another map, and what was announced before is void. A node begins a frame that it joins late, such as the
// fallback node, at whatever step the frame is.
bool CdNodeRole::follow(FrameControl::Announced announced) {
  using enum AnnouncedStep;
  if (awaits_map_) {
    return false;
  }
  bool any = false;
  if (state_.stage == CdNodeStage::waiting && (announced.step() == frame_begin || announced.step() == positions_sent)) {
    const std::uint64_t frame = exchange_->announced_frame();
    if (!announced.is_of(frame)) {
      return false;  // this node is lost, and the server is in another frame
    }
    begin(frame);
    any = true;
  }
  if (!announced.is_of(state_.frame) || !announced.has_epoch(state_.region.map().epoch()) ||
      state_.stage == CdNodeStage::waiting) {
    return any;
  }
  if (announced.step() >= positions_sent && !state_.received.positions) {
    state_.received.positions = true;
    if (state_.stage == CdNodeStage::gathering) {
      end_wait();
    }
    any = true;
  }
  if (announced.step() == frame_end && state_.stage == CdNodeStage::ending && !state_.received.frame_end) {
    end_wait();
    end_frame(state_.contacts.end);
    any = true;
  }
  return any;
}

void CdNodeRole::begin(std::uint64_t frame) {
  state_.begin(frame);
  detector_.begin();
  migration_.begin();
  cpu_start_ = telemetry::working_cpu_ns();
  mover_.begin();
  state_.stage = CdNodeStage::moving;
}

void CdNodeRole::detect() {
  detector_.test_all();
  telemetry::SpanTimer time(state_.setup.track, "narrow phase", state_.stats.narrow_phase_ns);
  detector_.finish();
  exchange_->list_kinds(detector_.kinds());
  publisher_.list();
  migration_.list();
}

// Whether the injected fault is due: then the role stops, or stalls for a while.
bool CdNodeRole::stops_here() noexcept {
  static_assert(static_cast<int>(CdNodeStage::reporting) == static_cast<int>(NodeStage::reporting) + 1);
  return state_.stage != CdNodeStage::waiting &&
         state_.fault.stops_before(static_cast<NodeStage>(static_cast<int>(state_.stage) - 1), state_.frame);
}

// Invalid messages are discarded and counted. If there were any, the caller of step() ends the role.
bool CdNodeRole::receive_from_server() {
  const bool checks = !exchange_->trusts_senders();
  return drain(
      *state_.setup.server.in, state_.host.state_bytes(),
      [&](const MessageView& message) {
        if (checks && !expected_.is_acceptable(message)) [[unlikely]] {
          ++invalid_messages_;
        } else {
          receive(message);
        }
      },
      [this] { ++invalid_messages_; });
}

// The rings of the other nodes are read only while their messages are expected: polling all of them at every step would
// cost 1 % of the work of 16 nodes. A node that sends earlier may have to wait for room in its ring, but nothing that
// this node does before depends on it.
bool CdNodeRole::awaits_peers() const noexcept {
  const bool ending =
      state_.received.frame_end && state_.stage >= CdNodeStage::ending && state_.stage <= CdNodeStage::settling;
  const bool gathering =
      state_.stage == CdNodeStage::gathering && state_.received.positions && exchange_->expects_ghosts();
  return ending || gathering;
}

bool CdNodeRole::receive_from_peers() {
  return awaits_peers() &&
         inbox_.read(
             state_.host.state_bytes(), [this](const MessageView& message) { return judge(message); },
             [this](const MessageView& message) { receive_from_peer(message); }, [this] { ++invalid_messages_; });
}

PeerInbox::Verdict CdNodeRole::judge(const MessageView& message) noexcept {
  if (!exchange_->trusts_senders() && !expected_.is_from_peer(message)) [[unlikely]] {
    ++invalid_messages_;
    return PeerInbox::Verdict::drop;
  }
  return expected_.judge(message);
}

void CdNodeRole::receive_from_peer(const MessageView& message) {
  switch (message.type()) {
    case MessageType::ghost:
      exchange_->count_ghosts(message.count());
      return halo_.apply(message);
    case MessageType::notify:
      return exchange_->receive_contacts(message);
    default:
      return migration_.receive(message);
  }
}

void CdNodeRole::receive(const MessageView& message) {
  switch (message.type()) {
    case MessageType::adopt:
      halo_.renew_filters(message);
      state_.host.apply(message);
      return;
    case MessageType::query:
      return exchange_->receive_queries(message);
    case MessageType::sensed:
      return exchange_->receive_sensed(message);
    case MessageType::frame_begin:
      return begin(message.header().frame);
    case MessageType::position_update:
      return halo_.receive_positions(message);
    case MessageType::pairs:
      return detector_.receive_pairs(message);
    case MessageType::unlist:
      return publisher_.unlist(message);
    case MessageType::correct:
      return publisher_.receive_corrections(message);
    case MessageType::notify:
      return publisher_.receive_late(message);
    case MessageType::ghosts_sent:
      return exchange_->expect_ghosts(message.record<messages::GhostsSentRecord>(0).ghosts);
    case MessageType::region_map:
      awaits_map_ &= !message.last();
      return halo_.receive_map(message);
    case MessageType::lost:
      for (std::size_t i = 0; i < message.count(); ++i) {
        lose(message.record<messages::LostRecord>(i));
      }
      return;
    case MessageType::probe:
      return probe_reply_run_.start(0);
    case MessageType::frame_end:
      return end_frame(message.record<messages::FrameEndRecord>(0));
    default:
      state_.host.apply(message);
  }
}

void CdNodeRole::end_frame(const messages::FrameEndRecord& end) {
  migration_.expect(end.hand_overs);
  exchange_->expect_contacts(end.contacts);
  if (end.hosts_exchange_objects != 0) {
    state_.host.list_all(true);
  }
  state_.received.frame_end = true;
}

// A peer is lost. Either the frame is detected again, under a map that follows; or its contacts are known, and the
// server takes over the hand-overs between the two nodes.
void CdNodeRole::lose(const messages::LostRecord& record) {
  if (state_.stage == CdNodeStage::waiting && record.detect_again == 0) {
    // This node is done, so no hand-over is pending between the two, and the slot may already belong to another node.
    return;
  }
  migration_.lose(record);
  exchange_->lose(record);
  if (record.detect_again != 0) {
    detect_again();
  }
}

void CdNodeRole::detect_again() {
  awaits_map_ = true;
  state_.region.discard_entries();
  state_.await_positions();
  exchange_->discard_ghosts();
  detector_.discard();
  answerer_.discard();
  if (state_.stage != CdNodeStage::waiting) {
    state_.host.contacts().begin(state_.frame);
  }
  if (state_.stage == CdNodeStage::colliding || state_.stage == CdNodeStage::ending) {
    wait_start_ = cpu_spent();
    state_.stage = CdNodeStage::gathering;
  }
}

bool CdNodeRole::answer_probe() {
  if (probe_reply_run_.done()) {
    return false;
  }
  exchange_->flush();
  return state_.send_empty(probe_reply_run_, MessageType::probe_reply);
}

// The CPU time since wait_start_ does not count: what a thread spends on polls and on falling asleep, it would not
// spend if it did not wait.
void CdNodeRole::end_wait() noexcept {
  if (!state_.setup.shares_thread) {
    cpu_start_ = telemetry::working_cpu_ns() - wait_start_;
  }
}

// CPU time in this frame so far, without waits.
std::uint64_t CdNodeRole::cpu_spent() const noexcept {
  return state_.setup.shares_thread ? state_.stats.busy_ns + (telemetry::now_ns() - step_start_)
                                    : telemetry::working_cpu_ns() - cpu_start_;
}

bool CdNodeRole::report_done() {
  messages::NodeFrameStats stats = state_.stats;
  stats.cpu_ns = cpu_spent();
  stats.busy_ns += telemetry::now_ns() - step_start_;
  state_.host.report(stats);
  const TrafficReport& m5 = state_.traffic[static_cast<std::size_t>(Traffic::m5)];
  stats.m5_messages = m5.messages;
  stats.m5_bytes = m5.bytes;
  if (!exchange_->report_done(stats)) {
    return false;
  }
  state_.stats = stats;
  return true;
}

}  // namespace ringfence::nodes
