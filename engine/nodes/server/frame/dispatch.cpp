#include "nodes/server/frame/dispatch.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/prefetch.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

Dispatch::Dispatch(ServerState& state)
    : state_(state),
      sweep_(state.setup.placement == Placement::server ? state.setup.capacities.objects : 0,
             state.setup.placement == Placement::server ? state.setup.capacities.pairs : 0, state.setup.layer_masks,
             state.setup.keep_resting) {
  resize();
  const std::size_t objects = state.setup.capacities.objects;
  hosted_by_nodes_.reserve(objects);
  prepared_.reserve(max_prepared);
  for (Node& node : nodes_) {
    node.updates.reserve(std::min(objects, 2 * objects / nodes_.size() + 64));
  }
}

void Dispatch::resize() {
  nodes_.resize(state_.nodes.size());
  stamps_.resize(state_.nodes.size(), 0);
}

void Dispatch::begin() {
  constexpr std::size_t ahead = 8;
  for (NodeNumber slot = 0; slot < nodes_.size(); ++slot) {
    base::prefetch_object(nodes_[std::min(slot + ahead, nodes_.size() - 1)]);
    base::prefetch_for_read(&state_.nodes[std::min(slot + ahead, nodes_.size() - 1)]);
    nodes_[slot].updates.clear();
    nodes_[slot].prepared = 0;
    nodes_[slot].link = state_.nodes[slot].is_active() ? state_.nodes[slot].connection.out : nullptr;
  }
  seen_ = 0;
  hosted_by_nodes_.clear();
  last_host_ = Endpoint::none();
  avatar_owners_.reset();
  if (state_.map.has_cuts()) {
    state_.objects.keep_notified_bounds();
  }
}

void Dispatch::prepare() {
  begin();
  each_unnotified([this](std::uint32_t slot) {
    if (state_.objects.host(slot).is_node()) {
      hosted_by_nodes_.push_back(slot);
    } else {
      list_update(slot, false);
    }
  });
  seen_ = state_.objects.unnotified().size();
  prepared_.clear();
  for (Node& node : nodes_) {
    node.first_prepared = prepared_.size();
    node.prepared = std::min(node.updates.size(), max_prepared - prepared_.size());
    for (std::size_t i = 0; i < node.prepared; ++i) {
      prepared_.push_back(position_of(node.updates[i]));
    }
  }
  is_prepared_ = true;
}

template <class Visit>
void Dispatch::each_unnotified(Visit visit) const {
  constexpr std::size_t ahead = 8;
  const auto unnotified = state_.objects.unnotified();
  for (std::size_t i = seen_; i < unnotified.size(); ++i) {
    if (i + ahead < unnotified.size()) {
      state_.objects.prefetch_bounds(unnotified[i + ahead]);
    }
    visit(unnotified[i]);
  }
}

void Dispatch::list_updates(UpdateScope scope) {
  const ObjectTable& objects = state_.objects;
  const auto is_anew = [&](std::uint32_t slot) {
    return scope == UpdateScope::all_objects || (scope == UpdateScope::not_hosted && !objects.host(slot).is_node());
  };
  if (scope != UpdateScope::changes) {
    for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
      if (is_anew(slot)) {
        list_update(slot, true);
      }
    }
  }
  if (scope == UpdateScope::all_objects) {
    return;
  }
  for (const std::uint32_t slot : hosted_by_nodes_) {
    list_update(slot, false);
  }
  each_unnotified([&](std::uint32_t slot) {
    if (!is_anew(slot)) {
      list_update(slot, false);
    }
  });
}

// Adds the object to the updates of the nodes whose regions it touches, and its removal to those of the nodes whose
// regions it no longer touches.
void Dispatch::list_update(std::uint32_t slot, bool all_objects) {
  ObjectTable& objects = state_.objects;
  const regions::RegionMap& map = state_.map;
  ObjectMarks& marks = objects.marks(slot);
  const bool present = objects.present()[slot] != 0;
  const Endpoint host = objects.host(slot);
  const bool cuts = map.has_cuts();
  // A host needs no update of an object that it reported in this frame, because it has changed its own entry. After a
  // change of the map it needs all updates, because every node has cleared its entries.
  const bool by_host = (marks & reported_mark) != 0 && host.is_node() && !all_objects;
  if (by_host && (marks & (inner_mark | shared_mark)) == inner_mark) {
    marks |= notified_mark;
    return;
  }
  const regions::CellBox now = present ? map.grid().cells_of(objects.bounds()[slot]) : regions::CellBox{};
  const NodeNumber self = by_host ? host.number() : 0xffffffffu;
  const NodeNumber next = host.is_node() ? host.number() : 0xffffffffu;
  bool shared = false;
  ++stamp_;
  // The avatars of a user who has many often stand together.
  const bool follows = host.is_user() && host == last_host_;
  last_host_ = host;
  if (present) {
    const auto notify_node = [&](NodeNumber node) {
      shared |= node != next;
      if (node != self) {
        nodes_[node].updates.push_back(slot);
      }
    };
    if (follows) {
      for (const NodeNumber node : avatar_owners_.of(map, objects.bounds()[slot])) {
        stamps_[node] = stamp_;
        notify_node(node);
      }
    } else {
      cuts ? regions::for_each_owner(map, objects.bounds()[slot], stamps_, stamp_, notify_node)
           : regions::for_each_owner(map, now, stamps_, stamp_, notify_node);
    }
  }
  const regions::CellBox notified_cells = objects.notified_cells(slot);
  const bool same_owners =
      present && now == notified_cells &&
      (!cuts || (follows ? avatar_owners_.covers(objects.notified_bounds(slot)) : !map.has_cuts(now)));
  if ((marks & notified_mark) != 0 && !all_objects && !same_owners) {
    // Stamped nodes receive the new position. Other nodes that have received the object before receive its removal.
    const auto leave = [&](NodeNumber node) {
      if (node != self) {
        nodes_[node].updates.push_back(slot | gone);
      }
    };
    const bool host_alone = (marks & shared_mark) == 0 && host.is_node();
    if (host_alone && stamps_[host.number()] != stamp_) {
      leave(host.number());
    } else if (!host_alone) {
      cuts ? regions::for_each_owner(map, objects.notified_bounds(slot), stamps_, stamp_, leave)
           : regions::for_each_owner(map, notified_cells, stamps_, stamp_, leave);
    }
  }
  objects.notified_cells(slot) = now;
  if (cuts && present) {
    objects.notified_bounds(slot) = objects.bounds()[slot];
  }
  marks = static_cast<ObjectMarks>((marks & ~(notified_mark | shared_mark)) | (present ? notified_mark : 0) |
                                   (shared ? shared_mark : 0));
}

void Dispatch::start(UpdateScope scope, const ServerExchange& exchange) {
  // Under a new map all is listed again.
  if (!std::exchange(is_prepared_, false) || scope != UpdateScope::changes) {
    begin();
  }
  list_updates(scope);
  for (Node& node : nodes_) {
    if (node.link != nullptr) {
      exchange.start_run(node.update_run, MessageType::position_update, node.updates.size());
    } else {
      node.update_run.stop();
    }
    node.pair_run.start();
  }
  sweeping_ = false;
  found_ = {};
  candidates_ = 0;
  sweep_ns_ = 0;
}

bool Dispatch::send_pairs() {
  if (state_.setup.placement == Placement::region) {
    return true;
  }
  const std::uint64_t begin_ns = telemetry::now_ns();
  const bool all = pump_pairs();
  sweep_ns_ += telemetry::now_ns() - begin_ns;
  return all;
}

messages::PositionRecord Dispatch::position_of(std::uint32_t update) const noexcept {
  const ObjectTable& objects = state_.objects;
  const std::uint32_t slot = update & ~gone;
  const ObjectRow& row = objects.row(slot);
  messages::PositionRecord record{.object = row.object,
                                  .pose = row.pose,
                                  .bounds = objects.bounds()[slot],
                                  .shape = row.shape,
                                  .layer = row.layer,
                                  .category = row.category,
                                  .group = objects.group(slot),
                                  .crowd = objects.crowd(slot),
                                  .user_data = objects.origin(slot).user_data};
  if ((update & gone) != 0) {
    record.object.flags |= messages::flag_left_region;
  }
  if (row.category == static_cast<std::uint16_t>(Category::avatar)) {
    record.object.flags |= messages::flag_avatar;
  } else if (row.category == static_cast<std::uint16_t>(Category::fixed)) {
    record.object.flags |= messages::flag_fixed;
  }
  return record;
}

bool Dispatch::pump_updates(NodeNumber to) {
  constexpr std::size_t ahead = 8;
  Node& node = nodes_[to];
  return state_.send(state_.nodes[to], node.update_run, MessageType::position_update, [&](std::size_t i) {
    if (i < node.prepared) {
      return prepared_[node.first_prepared + i];
    }
    if (i + ahead < node.updates.size()) {
      state_.objects.prefetch_position(node.updates[i + ahead] & ~gone);
    }
    return position_of(node.updates[i]);
  });
}

void Dispatch::flush(NodeNumber node) {
  nodes_[node].pair_run.flush(*nodes_[node].link, pairs_to(node), sizeof(messages::PairRecord),
                              state_.report().traffic);
}

// Sends pairs while the sweep continues, so that nodes test the first pairs while the server finds the last.
bool Dispatch::pump_pairs() {
  const ObjectTable& objects = state_.objects;
  const regions::RegionMap& map = state_.map;
  messages::TrafficCounts& counts = state_.report().traffic;
  messages::RunHeader head = state_.head(MessageType::pairs, Endpoint::none());
  constexpr std::size_t pairs_per_batch = 4096;
  const auto bounds = objects.bounds();
  const auto numbers = objects.numbers();
  const NodeNumber sole_owner = map.sole_owner();
  if (!sweeping_) {
    sweeping_ = true;
    sweep_.begin(bounds, objects.present(), objects.resting(), objects.layers(), objects.groups(), objects.crowds());
    found_ = sweep_.next(pairs_per_batch);
  }
  for (; !found_.empty(); found_ = sweep_.next(pairs_per_batch)) {
    for (std::size_t i = 0; i < found_.size(); ++i) {
      const geometry::CandidatePair pair = found_[i];
      const NodeNumber owner =
          sole_owner != regions::RegionMap::many_owners ? sole_owner : map.pair_owner(bounds[pair.a], bounds[pair.b]);
      head.destination = Endpoint::node(owner);
      std::byte* where = nodes_[owner].pair_run.add(*nodes_[owner].link, head, sizeof(messages::PairRecord), counts);
      if (where == nullptr) {
        found_ = found_.subspan(i);
        return false;
      }
      const bool ordered = numbers[pair.a] < numbers[pair.b];
      const messages::PairRecord record =
          ordered ? messages::PairRecord{pair.a, pair.b} : messages::PairRecord{pair.b, pair.a};
      std::memcpy(where, &record, sizeof record);
      ++candidates_;
    }
  }
  bool all = true;
  for (NodeNumber node = 0; node < nodes_.size(); ++node) {
    all &= nodes_[node].link == nullptr ||  // no node: it owns nothing
           nodes_[node].pair_run.finish(*nodes_[node].link, pairs_to(node), sizeof(messages::PairRecord), counts);
  }
  return all;
}

}  // namespace ringfence::nodes
