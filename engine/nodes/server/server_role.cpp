#include "nodes/server/server_role.hpp"

#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

ServerRole::ServerRole(const ServerSetup& setup, const regions::RegionMap& map)
    : state_(setup, map),
      statistics_(state_),
      exchange_(ServerExchange::make(state_)),
      states_(state_, *exchange_),
      dispatch_(state_),
      scheduler_(state_, *exchange_, states_),
      cut_(state_, *exchange_, states_, scheduler_, dispatch_),
      opening_(state_, *exchange_),
      relay_(state_, *exchange_),
      node_ingest_(state_, *exchange_, states_, statistics_),
      user_ingest_(state_, statistics_),
      router_(state_, *exchange_, states_, relay_, statistics_),
      failover_(state_, *exchange_, states_, relay_, statistics_),
      deadlines_(state_, failover_, dispatch_),
      frames_(setup.first_frame) {}

Step ServerRole::step() {
  bool progressed = false;
  if (state_.stage == FrameStage::waiting) {
    if (state_.setup.order->ordered.load(std::memory_order_acquire) == frames_) {
      return Step::idle;
    }
    cut();
    progressed = true;
  }
  progressed |= node_ingest_.receive();
  progressed |= user_ingest_.receive();
  if (node_ingest_.take_broken()) [[unlikely]] {
    failover_.lose_broken_nodes();
  }
  if (!state_.report().lost.empty()) {
    progressed |= node_ingest_.refuse_lost();
  }
  bool advanced = false;
  while (advance()) {
    advanced = true;
  }
  // Receiving is not progress: a flooding sender must not postpone the deadline check.
  if (advanced || (deadlines_.is_watching() && deadlines_.check(telemetry::now_ns())) || progressed) {
    return Step::progressed;
  }
  const bool sending = state_.stage == FrameStage::starting_nodes || state_.stage == FrameStage::starting_users ||
                       state_.stage == FrameStage::dispatching || state_.stage == FrameStage::notifying ||
                       state_.stage == FrameStage::notifying_users;
  return sending ? Step::blocked : Step::idle;
}

bool ServerRole::lose(NodeNumber node) {
  if (state_.stage == FrameStage::waiting) {
    return false;
  }
  failover_.lose(node);
  return true;
}

void ServerRole::restore(std::span<const RestoredObject> objects, std::size_t state_bytes,
                         std::span<Contact> contacts) {
  cut_.restore(objects, state_bytes);
  state_.ledger.restore(frames_, contacts, state_.objects);
}

bool ServerRole::list_answers(std::vector<const NodeQueries*>& answers) const {
  answers.clear();
  if (!report(state_.frame).lost.empty()) {
    return false;  // the thread of a lost node may still write its answers
  }
  bool all = true;
  for (const PeerSession& node : state_.nodes) {
    if (node.connected) {
      answers.push_back(&exchange_->queries_of(node));
      all &= answers.back()->frame == state_.frame;
    }
  }
  return all;
}

void ServerRole::cut() {
  state_.frame = frames_++;
  state_.objects.begin_frame(state_.frame);
  statistics_.begin();
  const bool any_lost = cut_.begin();
  cut_.apply_requests();
  if (any_lost) {
    failover_.replace_lost_nodes();
  }
  statistics_.list_nodes();
  failover_.rehost_recovered();
  cut_.assign_hosts();
  cut_.list_known_contacts();
  relay_.begin();
  state_.ledger.begin(state_.frame);
  exchange_->begin();
  exchange_->begin_queries();
  if (state_.setup.sense > 0) {
    exchange_->begin_senses();
    state_.host.set_sensed(state_.setup.publications->sensed);
  }
  state_.host.contacts().read(state_.ledger.contacts(state_.frame - 1), state_.ledger.keys(state_.frame - 1));
  states_.begin();
  node_ingest_.begin();
  failover_.begin();
  deadlines_.begin();
  exchange_->expect_nodes();
  opening_.start_nodes();
  state_.stage = FrameStage::starting_nodes;
}

void ServerRole::detect() {
  statistics_.charge(Stage::move);
  state_.dispatch_ns = statistics_.mark_ns();
  const bool all_objects = state_.map_change.updates == UpdateScope::all_objects;
  if (all_objects) {
    states_.store_all();
  }
  exchange_->begin_ghosts(!all_objects && state_.setup.placement == Placement::region);
  dispatch_.start(std::exchange(state_.map_change.updates, UpdateScope::changes), *exchange_);
}

// While nodes still move, the server would wait.
void ServerRole::prepare_dispatch() {
  if (state_.nodes_host() && !state_.setup.nodes_may_be_lost && state_.awaited_users == 0 &&
      state_.map_change.updates == UpdateScope::changes && !dispatch_.is_prepared()) {
    dispatch_.prepare();
  }
}

// Where no node may be lost, all that the next hosts depend on is known when the nodes have moved, unless the map
// changes.
void ServerRole::assign_next_hosts_early() {
  if (exchange_->reads_nodes() && !state_.setup.nodes_may_be_lost && !scheduler_.is_map_due()) {
    router_.assign_next_hosts();
    next_hosts_assigned_ = true;
  }
}

// Makes one transition of the frame; false if it has to wait.
bool ServerRole::advance() { return (!failover_.is_pending() || failover_.send()) && advance_stage(); }

bool ServerRole::advance_stage() {
  switch (state_.stage) {
    case FrameStage::waiting:
      return false;
    case FrameStage::starting_nodes:
      if (!state_.send_to_nodes([&](const PeerSession& node) { return opening_.has_opening(node); },
                                [&](PeerSession& node) {
                                  return exchange_->send_queries(node) && exchange_->send_sensed(node) &&
                                         opening_.open(node) &&
                                         (state_.wakes_together() || Statistics::note_reached(node.started));
                                })) {
        return false;
      }
      exchange_->announce(AnnouncedStep::frame_begin, &PeerSession::started);
      statistics_.charge_cpu(&PathReport::start_nodes_ms);
      statistics_.charge_reached(state_.report().path.start_nodes_ms, state_.begin_ns, &PeerSession::started);
      opening_.start_users();
      deadlines_.begin_moves(telemetry::now_ns());
      state_.stage = FrameStage::starting_users;
      return true;
    case FrameStage::starting_users:
      if (!opening_.open_users()) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::start_users_ms);
      // In user/server deployment the server is a host; otherwise it hosts only objects without another host.
      state_.host.move(state_.frame);
      states_.apply_moves(state_.host);
      state_.stage = FrameStage::moving;
      return true;
    case FrameStage::moving:
      if (!node_ingest_.all_completed(ReportedStep::moved) || state_.awaited_users != 0) {
        prepare_dispatch();
        return false;
      }
      statistics_.charge_cpu(&PathReport::ingest_ms);
      detect();
      state_.stage = FrameStage::dispatching;
      return true;
    case FrameStage::dispatching:
      if (!state_.send_to_nodes(
              [&](const PeerSession& node) { return dispatch_.has_updates(node); },
              [&](PeerSession& node) { return exchange_->send_ghosts(node) && dispatch_.send_updates(node); })) {
        return false;
      }
      // With placement `server` a node also waits for its pairs.
      exchange_->announce(AnnouncedStep::positions_sent,
                          state_.setup.placement == Placement::region ? &PeerSession::dispatched : nullptr);
      if (!dispatch_.send_pairs()) {
        return false;
      }
      if (state_.setup.placement == Placement::server) {
        state_.report().candidates = dispatch_.candidates();
      }
      // Sweeping and sending alternate; the report separates them.
      statistics_.charge_part(Stage::broad_phase, dispatch_.sweep_ns());
      statistics_.charge(Stage::dispatch);
      statistics_.charge_cpu(&PathReport::dispatch_ms);
      statistics_.charge_reached(state_.report().path.dispatch_ms, state_.dispatch_ns, &PeerSession::dispatched);
      // Poses are final, so states can be published while the nodes test.
      relay_.publish(failover_.holds_objects());
      statistics_.charge_cpu(&PathReport::publish_ms);
      statistics_.charge(Stage::notify);
      state_.stage = FrameStage::colliding;
      return true;
    case FrameStage::colliding:
      if (relay_.is_ready([this] { return node_ingest_.all_completed(ReportedStep::published); })) {
        statistics_.charge(Stage::narrow_phase);
        relay_.allow_reading();
        statistics_.charge_cpu(&PathReport::publish_ms);
        statistics_.charge(Stage::notify);
        // While the nodes test, so that it does not lengthen the frame.
        router_.list_next_hosts();
        scheduler_.plan();
        assign_next_hosts_early();
        statistics_.charge_cpu(&PathReport::plan_map_ms);
      }
      // A user thread publishes after the last states of its user nodes, so on a busy machine the nodes may be faster.
      if (!relay_.allows_reading() || !node_ingest_.all_completed(ReportedStep::tested)) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::receive_contacts_ms);
      statistics_.charge(Stage::narrow_phase);
      router_.resolve_phases();
      statistics_.charge(Stage::collect);
      scheduler_.change_map();
      if (!std::exchange(next_hosts_assigned_, false)) {
        router_.assign_next_hosts();
      }
      router_.start_nodes();
      statistics_.charge_cpu(&PathReport::collect_ms);
      state_.notify_ns = statistics_.mark_ns();
      state_.stage = FrameStage::notifying;
      return true;
    case FrameStage::notifying:
      if (!state_.send_to_nodes([&](const PeerSession& node) { return router_.has_notice(node); },
                                [&](PeerSession& node) {
                                  return router_.notify(node) &&
                                         (state_.wakes_together() || Statistics::note_reached(node.notified));
                                })) {
        return false;
      }
      exchange_->announce(AnnouncedStep::frame_end, &PeerSession::notified);
      statistics_.charge_cpu(&PathReport::notify_ms);
      statistics_.charge_reached(state_.report().path.notify_ms, state_.notify_ns, &PeerSession::notified);
      router_.start_users();
      state_.stage = FrameStage::notifying_users;
      return true;
    case FrameStage::notifying_users:
      // Users before nodes, since nodes need longer to end.
      if (router_.notify_users()) {
        statistics_.charge_cpu(&PathReport::notify_users_ms);
        if (router_.users_are_notified()) {
          node_ingest_.count_kinds();
        }
      }
      if (!state_.users_are_done()) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::receive_user_acks_ms);
      state_.stage = FrameStage::closing;
      return true;
    case FrameStage::closing:
      if (!node_ingest_.all_completed(ReportedStep::done) ||
          (exchange_->is_reading() && !deadlines_.has_abandoned_nodes()) || !state_.ledger.complete()) {
        return false;
      }
      finish();
      return false;
  }
  return false;
}

void ServerRole::finish() {
  router_.count_contacts();
  exchange_->finish();
  scheduler_.finish();
  statistics_.finish(states_.moved());
  state_.stage = FrameStage::waiting;
  state_.setup.order->completed.store(frames_, std::memory_order_release);
  if (state_.setup.order->caller != nullptr) {
    state_.setup.order->caller->ring();
  }
}

}  // namespace ringfence::nodes
