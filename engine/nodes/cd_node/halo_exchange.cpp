#include "nodes/cd_node/halo_exchange.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace ringfence::nodes {

HaloExchange::HaloExchange(NodeState& state) : state_(state) {
  if (shares_states()) {
    const std::size_t few = state.setup.objects / 8 + 64;  // few objects touch another region
    state.contacts.ghost_updates.reserve(few);
    received_.reserve(few);
  }
}

void HaloExchange::assign() {
  const std::vector<Connection>& peers = state_.setup.peers;
  stamps_.assign(peers.size(), 0);
  outgoing_.resize(peers.size());
  counts_.reserve(peers.size());
  keeps_host_owned_ = shares_states() || sends_messages();
}

bool HaloExchange::sends_messages() const noexcept {
  return !state_.shares_memory() && state_.setup.placement == Placement::region && state_.setup.hosts;
}

bool HaloExchange::shares_states() const noexcept {
  return state_.setup.server.node_contacts != nullptr && state_.setup.placement == Placement::region &&
         state_.setup.keeps_host_owned_states;
}

void HaloExchange::begin() {
  state_.contacts.ghost_updates.start(state_.frame);
  finished_ = false;
  discard();
}

void HaloExchange::discard() noexcept {
  for (Outgoing& outgoing : outgoing_) {
    outgoing.run.stop();
  }
  expected_ = unknown;
  arrived_ = 0;
}

void HaloExchange::add_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying, std::uint32_t was) {
  const Hosted& object = state_.host[hosted];
  const regions::RegionMap& map = state_.region.map();
  GhostUpdates& ghost_updates = state_.contacts.ghost_updates;
  ++stamp_;
  bool added = false;
  const auto add_receiver = [&](NodeNumber peer, bool gone) {
    if (peer == state_.setup.node) {
      return;
    }
    if (!added) {
      messages::ObjectRef update = object.object;
      update.flags = messages::flag_present | (staying ? messages::flag_keeps_host : 0u);
      ghost_updates.add(
          {update, object.pose, bounds, object.shape, object.layer, state_.host.group(hosted), 0, object.user_data});
      added = true;
    }
    ghost_updates.add_receiver(peer, gone);
  };
  const bool present = (object.object.flags & messages::flag_present) != 0;
  if (present) {
    regions::for_each_owner(map, bounds, stamps_, stamp_, [&](NodeNumber peer) { add_receiver(peer, false); });
  }
  if (was == RegionObjects::none || state_.objects.inner(was)) {
    return;
  }
  // Few objects pass from cell to cell in a frame, so usually no node loses one.
  const geometry::Bounds& bounds_before = state_.objects.bounds()[was];
  const regions::CellBox box = map.grid().cells_of(bounds_before);
  if (present && box == map.grid().cells_of(bounds) && !map.has_cuts(box)) {
    return;
  }
  regions::for_each_owner(map, bounds_before, stamps_, stamp_, [&](NodeNumber peer) { add_receiver(peer, true); });
}

bool HaloExchange::finish_updates() {
  GhostUpdates& ghost_updates = state_.contacts.ghost_updates;
  if (!std::exchange(finished_, true)) {
    ghost_updates.finish(static_cast<NodeNumber>(state_.setup.peers.size()));
    counts_.clear();
    for (NodeNumber to = 0; sends_messages() && to < outgoing_.size(); ++to) {
      base::FlatList<GhostUpdates::Update>& updates = outgoing_[to].updates;
      updates.clear();
      ghost_updates.list(to, updates);
      if (!updates.empty()) {
        outgoing_[to].run.start(updates.size());
        counts_.push_back({to, static_cast<std::uint32_t>(updates.size())});
      }
    }
    if (!counts_.empty()) {
      counts_run_.start(counts_.size());
    }
  }
  return state_.send_counts(counts_run_, messages::MessageType::ghost_counts, counts_);
}

bool HaloExchange::send_updates() {
  bool all = true;
  for (NodeNumber to = 0; to < outgoing_.size(); ++to) {
    Outgoing& outgoing = outgoing_[to];
    if (outgoing.run.done()) {
      continue;
    }
    const messages::RunHeader head = state_.head(messages::MessageType::ghost, messages::Endpoint::node(to));
    all &= outgoing.run.pump(*state_.setup.peers[to].out, head, sizeof(messages::PositionRecord), state_.traffic,
                             [&](std::size_t i, std::byte* where) {
                               messages::PositionRecord record = *outgoing.updates[i].record;
                               record.object.flags |= outgoing.updates[i].gone ? messages::flag_left_region : 0u;
                               std::memcpy(where, &record, sizeof record);
                             });
  }
  return all;
}

bool HaloExchange::receive_updates() {
  if (sends_messages()) {
    return expected_ != unknown && arrived_ >= expected_;
  }
  if (state_.shares_memory() && state_.contacts.ghost_updates.gate.enter()) {
    read_updates();
    state_.contacts.ghost_updates.gate.leave();
  }
  return true;
}

void HaloExchange::receive(const messages::MessageView& message) {
  arrived_ += message.count();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    apply_update(record, (record.object.flags & messages::flag_left_region) != 0);
  }
}

void HaloExchange::read_updates() {
  state_.fault.pass(NodeStage::gate, state_.frame);
  received_.clear();
  for (const Connection& peer : state_.setup.peers) {
    if (peer.node_contacts != nullptr && peer.node_contacts->ghost_updates.frame() == state_.frame) {
      peer.node_contacts->ghost_updates.list(state_.setup.node, received_);
    }
  }
  // The updates of all peers form one list, since each peer has only a few dozen. Three dependent reads are prefetched
  // in a pipeline: the record, written by another core; the index of its object; the object's entry.
  constexpr std::size_t ahead = 6;
  const auto behind = [&](std::size_t i, std::size_t by) {
    return i >= by && i - by < received_.size() ? &received_[i - by] : nullptr;
  };
  for (std::size_t i = 0; i < received_.size() + 3 * ahead; ++i) {
    if (const GhostUpdates::Update* update = behind(i, 0)) {
      GhostUpdates::prefetch(*update->record);
    }
    if (const GhostUpdates::Update* update = behind(i, ahead)) {
      state_.objects.prefetch_index(update->record->object.slot);
    }
    if (const GhostUpdates::Update* update = behind(i, 2 * ahead)) {
      state_.objects.prefetch(state_.objects.find(update->record->object.slot));
    }
    if (const GhostUpdates::Update* update = behind(i, 3 * ahead)) {
      apply_update(*update->record, update->gone);
    }
  }
}

void HaloExchange::receive_positions(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    apply_position(record, (record.object.flags & messages::flag_left_region) != 0);
  }
  state_.received.positions |= message.last();
}

void HaloExchange::apply_position(const messages::PositionRecord& record, bool gone) {
  if (gone) {
    state_.objects.remove(record.object.slot);
    return;
  }
  const NextHost next = next_host(record);
  const bool inner = next == NextHost::self &&
                     state_.region.map().coverage(record.bounds, state_.setup.node) == regions::Coverage::all;
  const auto filter = [&] {
    return PairFilter::of(record.layer, (record.object.flags & messages::flag_fixed) != 0, record.group);
  };
  state_.objects.set_filter(state_.objects.set(record, record.bounds, filter, next, inner), filter());
}

void HaloExchange::renew_filters(const messages::MessageView& adoptions) {
  for (std::size_t i = 0; i < adoptions.count(); ++i) {
    const auto record = adoptions.record<messages::HandOverRecord>(i);
    const std::uint32_t known = state_.objects.find(record.object.slot);
    if (known != RegionObjects::none && state_.objects.numbers()[known] == record.object.number) {
      state_.objects.set_filter(known, PairFilter::of(record.layer, false, record.group));  // hosted: not static
    }
  }
}

// If flag_keeps_host is set, the sender of the update hosts the object in the next frame too. The sender has the same
// map, so the next host is not computed again.
void HaloExchange::apply_update(const messages::PositionRecord& record, bool gone) {
  if (gone || (record.object.flags & messages::flag_keeps_host) == 0) {
    return apply_position(record, gone);
  }
  const auto filter = [&] { return PairFilter::of(record.layer, false, record.group); };  // hosted: not static
  state_.objects.set(record, record.bounds, filter, NextHost::node, false);
}

NextHost HaloExchange::next_host(const messages::PositionRecord& record) const noexcept {
  if ((record.object.flags & (messages::flag_avatar | messages::flag_fixed)) != 0) {
    return (record.object.flags & messages::flag_avatar) != 0 ? NextHost::user : NextHost::none;
  }
  return state_.setup.hosts && state_.region.contains(record.pose.position) ? NextHost::self : NextHost::node;
}

// After a change of the map every node receives all objects in its region again: from the server, or from their hosts.
void HaloExchange::receive_map(const messages::MessageView& message) {
  if (state_.region.receive(message)) {
    state_.objects.clear();
    state_.host.list_all(false);
  }
}

}  // namespace ringfence::nodes
