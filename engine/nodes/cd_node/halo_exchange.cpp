#include "nodes/cd_node/halo_exchange.hpp"

#include <bit>

namespace ringfence::nodes {

HaloExchange::HaloExchange(NodeState& state) : state_(state) {
  if (state.keeps_host_owned()) {
    state.contacts.ghost_updates.reserve(state.setup.objects / 8 + 64);  // few objects touch another region
  }
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
      ghost_updates.add({update, object.pose, bounds, object.shape, object.layer, object.category,
                         state_.host.group(hosted), 0, object.user_data});
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

// The updates of all peers form one list, since each peer has only a few dozen. Three dependent reads are prefetched in
// a pipeline: the record, written by another core; the index of its object; the object's entry.
void HaloExchange::apply(std::span<const GhostUpdates::Update> updates) {
  constexpr std::size_t ahead = 6;
  const auto behind = [&](std::size_t i, std::size_t by) {
    return i >= by && i - by < updates.size() ? &updates[i - by] : nullptr;
  };
  for (std::size_t i = 0; i < updates.size() + 3 * ahead; ++i) {
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

void HaloExchange::apply(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    apply_update(record, (record.object.flags & messages::flag_left_region) != 0);
  }
}

void HaloExchange::receive_positions(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::PositionRecord>(i);
    apply_position(record, (record.object.flags & messages::flag_left_region) != 0);
  }
  state_.received.positions |= message.last() && !state_.shares_memory();
}

void HaloExchange::apply_position(const messages::PositionRecord& record, bool gone) {
  if (gone) {
    state_.objects.remove(record.object.slot);
    return;
  }
  const NextHost next = next_host(record);
  const bool inner = next == NextHost::self && state_.region.coverage(record.bounds) == regions::Coverage::all;
  const auto filter = [&] {
    return PairFilter::of(record.layer, (record.object.flags & messages::flag_fixed) != 0, record.group, record.crowd);
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
  if (state_.shares_memory()) {
    state_.region.take(*std::bit_cast<const regions::RegionMap*>(message.record<messages::OwnerRecord>(0)));
  } else if (!state_.region.receive(message)) {
    return;
  }
  state_.objects.clear();
  state_.host.list_all(false);
}

}  // namespace ringfence::nodes
