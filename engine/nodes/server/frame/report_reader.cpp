#include "nodes/server/frame/report_reader.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/publications.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::MessageType;

bool& has_completed(PeerSession::Received& received, ReportedStep step) noexcept {
  switch (step) {
    case ReportedStep::none:
    case ReportedStep::moved:
      return received.states;
    case ReportedStep::published:
      return received.published;
    case ReportedStep::tested:
      return received.narrow_done;
    case ReportedStep::done:
      break;
  }
  return received.frame_done;
}

void ReportReader::begin() noexcept {
  seen_ = {};
  arrived_ = {};
  nodes_ = static_cast<std::size_t>(std::count_if(state_.nodes.begin(), state_.nodes.end(),
                                                  [](const PeerSession& node) { return node.is_active(); }));
  missing_.fill(nodes_);
}

void ReportReader::note(const Seen& seen) noexcept {
  std::uint64_t& word = seen_[index_of(seen.step)][seen.slot / 64];
  const std::uint64_t bit = std::uint64_t{1} << seen.slot % 64;
  missing_[index_of(seen.step)] -= (word & bit) == 0 ? 1 : 0;
  word |= bit;
}

void ReportReader::look() {
  list();
  load_marks();
}

void ReportReader::list() {
  reports_.clear();
  // All that may be listed: how many are new at once depends on when the threads run.
  reports_.reserve(reported_steps * state_.nodes.size());
  for (const ReportedStep step :
       {ReportedStep::moved, ReportedStep::published, ReportedStep::tested, ReportedStep::done}) {
    if (!is_counted(step)) {
      list(step);
      continue;
    }
    for (std::size_t group = 0; group < groups(); ++group) {
      arrived_[index_of(step)][group] = state_.setup.frame_control->arrived(step, group);
    }
  }
}

// In a frame with a loss every node is looked at: some have completed a step of the detection before, and may not
// arrive a second time.
void ReportReader::list(ReportedStep step) {
  const bool any_lost = !state_.report().lost.empty();
  for (std::size_t group = 0; group < groups(); ++group) {
    std::uint64_t fresh = state_.setup.frame_control->arrived(step, group) & ~seen_[index_of(step)][group];
    for (fresh = any_lost ? ~std::uint64_t{0} : fresh; fresh != 0; fresh &= fresh - 1) {
      const auto slot = static_cast<NodeNumber>(group * 64 + static_cast<std::size_t>(std::countr_zero(fresh)));
      const bool waits = slot < state_.nodes.size() && state_.nodes[slot].is_active() &&
                         !(any_lost && has_completed(state_.nodes[slot].received, step));
      if (waits) {
        reports_.push_back({slot, step, {}});
      }
    }
  }
}

// A session and a report are on lines that this core has not had since the last step.
void ReportReader::load_marks() {
  if (!state_.setup.nodes_may_be_lost) {
    return;
  }
  for (std::size_t i = 0; i < reports_.size() + ahead; ++i) {
    if (i < reports_.size()) {
      base::prefetch_for_read(&state_.shared_nodes[reports_[i].slot]->report.reached);
    }
    if (i >= ahead) {
      // Pairs with the store in SharedExchange: what the node has written for this step is visible.
      Seen& seen = reports_[i - ahead];
      seen.reached = state_.shared_nodes[seen.slot]->report.reached.load(std::memory_order_acquire);
    }
  }
}

void ReportReader::prefetch_report(const Seen& seen) const noexcept {
  state_.nodes[seen.slot].prefetch_frame();
  if (!has_reached(seen)) {
    return;  // the node may be writing it
  }
  const NodeContacts& contacts = *state_.shared_nodes[seen.slot];
  if (seen.step == ReportedStep::tested) {
    base::prefetch_for_read(&contacts.report.totals);
    contacts.prefetch_summary();
  } else if (seen.step == ReportedStep::done) {
    base::prefetch_object(contacts.report.stats);
  }
}

void ReportReader::count_kinds() {
  kinds_.clear();
  state_.each_shared_node([](const NodeContacts& node) { base::prefetch_for_read(&node.report.kinds); },
                          [this](NodeNumber, const NodeContacts& node) { kinds_.push_back(node.report.kinds); });
  constexpr std::size_t nodes_ahead = 2;
  for (std::size_t i = 0; i < kinds_.size() + nodes_ahead; ++i) {
    for (std::size_t k = 0; i < kinds_.size() && k < kinds_[i].size(); ++k) {
      base::prefetch_for_read(&kinds_[i][k]);
      base::prefetch_for_read(&kinds_[i][k].timed);
    }
    if (i >= nodes_ahead) {
      const auto kinds = kinds_[i - nodes_ahead];
      statistics_.count_report(MessageType::kinds, kinds.size(), sizeof(messages::KindRecord));
      results_.add_kinds(kinds);
    }
  }
}

// The messages of a run without records are counted as if they had been sent.
bool ReportReader::accept_counted(ReportedStep step) {
  std::size_t fresh = 0;
  for (std::size_t group = 0; group < groups(); ++group) {
    std::uint64_t& seen = seen_[index_of(step)][group];
    fresh += static_cast<std::size_t>(std::popcount(arrived_[index_of(step)][group] & ~seen));
    seen |= arrived_[index_of(step)][group];
  }
  missing_[index_of(step)] -= fresh;
  if (step == ReportedStep::published) {
    count_empty(MessageType::published, fresh);
  } else if (fresh != 0 && all(step)) {
    count_empty(MessageType::node_state, nodes_ - state_.state_senders);
  }
  return fresh != 0;
}

void ReportReader::count_empty(MessageType type, std::size_t messages) noexcept {
  for (std::size_t i = 0; i < messages; ++i) {
    statistics_.count_report(type, 0, 0);
  }
}

bool ReportReader::accept() {
  const std::uint64_t now = state_.setup.node_deadline_ns != 0 && !reports_.empty() ? telemetry::now_ns() : 0;
  bool any = false;
  for (const ReportedStep step : {ReportedStep::moved, ReportedStep::published}) {
    any |= is_counted(step) && accept_counted(step);
  }
  for (std::size_t i = 0; i < reports_.size() + ahead; ++i) {
    if (i < reports_.size() && state_.shared_nodes[reports_[i].slot] != nullptr) {
      prefetch_report(reports_[i]);
    }
    if (i < ahead || !state_.nodes[reports_[i - ahead].slot].is_active()) {
      continue;
    }
    const Seen& seen = reports_[i - ahead];
    PeerSession& node = state_.nodes[seen.slot];
    bool& known = has_completed(node.received, seen.step);
    if (!known && !may_accept(seen)) {
      continue;
    }
    if (!std::exchange(known, true)) {
      any = true;
      node.last_received_ns = now;
      node.probed_ns = 0;
      accept(node, seen.step);
    }
    note(seen);
  }
  return any;
}

bool ReportReader::may_accept(const Seen& seen) const noexcept {
  if (!state_.setup.nodes_may_be_lost) {
    return true;
  }
  if (!has_reached(seen)) {
    return false;
  }
  if (seen.step == ReportedStep::tested) {
    // Tests under an earlier map are void: a node was lost, and this one will report again.
    const bool detecting = state_.stage == FrameStage::dispatching || state_.stage == FrameStage::colliding;
    return detecting && seen.reached.has_epoch(state_.map.epoch());
  }
  return seen.step != ReportedStep::done || state_.contacts_are_final();
}

void ReportReader::accept(PeerSession& node, ReportedStep step) {
  const StepReport& report = node.connection.node_contacts->report;
  switch (step) {
    case ReportedStep::none:
      return;
    case ReportedStep::moved:  // with states the last message would have ended their run
      return node.received.bytes == 0 ? statistics_.count_report(MessageType::node_state, 0, 0) : void();
    case ReportedStep::published:
      return node.connection.publication != nullptr && node.connection.publication->wanted
                 ? statistics_.count_report(MessageType::published, 0, 0)
                 : void();
    case ReportedStep::tested:
      statistics_.count_report(MessageType::narrow_done, 1, sizeof report.totals);
      if (!results_.add_tests(node, report.totals)) {
        state_.refuse(Status::bad_message);
      }
      return;
    case ReportedStep::done:
      statistics_.count_report(MessageType::frame_done, 1, sizeof report.stats);
      return results_.finish(node, report.stats);
  }
}

}  // namespace ringfence::nodes
