// Planning of region maps: regions follow the load, and a changed number of nodes gets a new map.
//
// Contacts do not depend on the map, only the nodes' costs do. A map is planned over several frames, one step per
// frame, while the nodes test and the server would wait: first the objects and contacts are weighed, a slice per frame;
// then cells are refined; then they are partitioned. Only when the number of nodes changes, everything is done at once.
#include <algorithm>
#include <utility>

#include "nodes/server/server_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

namespace {

// Cost of a pair in the paper's world, including moving, sweeping and messages. Compared with the cost of a change of
// the map.
constexpr double ms_per_pair = 0.00025;

// Size of a slice: about 0.1 ms of weighing; larger worlds, whose frames take longer, need no more frames for it.
constexpr std::size_t min_slice = 8192;
constexpr std::size_t slices_per_map = 8;

}  // namespace

double ServerRole::cost_of(const NodeReport& node) const noexcept {
  return state_.setup.balance_by == BalanceBy::pairs ? ms_per_pair * static_cast<double>(node.tested) : node.cpu_ms;
}

// At the end of a frame: decides whether planning of a new map starts.
void ServerRole::compare_costs() {
  if (!state_.setup.balance) {
    return;
  }
  costs_.clear();
  const bool all_known = state_.all_nodes([&](const PeerSession& node) {
    costs_.push_back({node.self.number(), node.cost_ms});
    return node.cost_ms != PeerSession::no_cost;
  });
  if (costs_.size() < 2) {
    return;
  }
  if (all_known) {
    balance_.add_frame(costs_);
  }
  if (map_plan_.pass == MapPlan::Pass::none && balance_.needs_new_map()) {
    begin_weights();
  }
}

// At the end of a frame: adopts a new map for the next frame, if one is due.
void ServerRole::change_map() {
  if (!state_.report().lost.empty()) {
    // The next cut makes a new map. The facade decides again which nodes leave.
    for (PeerSession& session : state_.nodes) {
      session.leaving = false;
    }
    return;
  }
  if (std::exchange(partition_due_, false)) {
    begin_weights();
    weigh(~std::size_t{0});
    const auto table = partition();
    map_plan_ = {};
    return adopt_map(table);
  }
  if (map_plan_.pass == MapPlan::Pass::planned && is_for_current_map(map_plan_)) {
    adopt_map(map_plan_.table);
  }
  if (map_plan_.pass == MapPlan::Pass::planned) {
    map_plan_ = {};
  }
  compare_costs();
}

void ServerRole::adopt_map(std::span<const std::uint32_t> table) {
  state_.map.assign(table, static_cast<std::uint32_t>(state_.nodes.size()), state_.map.epoch() + 1);
  state_.map_change.at_end = true;
  state_.map_change.hosts_exchange_objects = shared_.can_exchange_objects();
  if (state_.map_change.hosts_exchange_objects) {
    note_renotified();
  } else {
    states_.store_all();
  }
}

// For objects that are not host-owned the server sends updates when they next move. Then it must know which nodes
// received them now: those whose regions the bounds touch.
void ServerRole::note_renotified() noexcept {
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.host(slot).is_node() && (state_.objects.marks(slot) & host_owned_mark) == 0) {
      state_.objects.note_notified(slot, state_.objects.bounds(slot), state_.map.grid(), true);
    }
  }
}

// While the nodes test: their objects do not move until the end of the frame.
void ServerRole::plan_map() {
  using Pass = MapPlan::Pass;
  if (map_plan_.pass == Pass::none || map_plan_.pass == Pass::planned) {
    return;
  }
  if (!is_for_current_map(map_plan_)) {
    map_plan_ = {};
    return;
  }
  switch (map_plan_.pass) {
    case Pass::weighing: {
      const std::size_t all = state_.objects.slots() + state_.ledger.contacts(state_.frame - 1).size();
      map_plan_.pass = weigh(std::max(min_slice, all / slices_per_map)) ? Pass::refining : Pass::weighing;
      break;
    }
    case Pass::refining:
      state_.list_remaining_nodes(remaining_);
      balance_.refine(state_.map, static_cast<std::uint32_t>(remaining_.size()));
      map_plan_.pass = Pass::sharing;
      break;
    case Pass::sharing:
      state_.list_remaining_nodes(remaining_);
      map_plan_.table =
          balance_.propose(state_.map, remaining_, shared_.can_exchange_objects() ? 0 : state_.objects.live());
      map_plan_.pass = map_plan_.table.empty() ? Pass::none : Pass::planned;
      break;
    case Pass::none:
    case Pass::planned:
      break;
  }
  statistics_.charge_cpu(&PathReport::plan_map_ms);
}

bool ServerRole::is_for_current_map(const MapPlan& drawing) const noexcept {
  return drawing.epoch == state_.map.epoch() && drawing.slots == state_.nodes.size();
}

void ServerRole::begin_weights() {
  map_plan_ = {};
  map_plan_.pass = MapPlan::Pass::weighing;
  map_plan_.epoch = state_.map.epoch();
  map_plan_.slots = state_.nodes.size();
  balance_.begin_weights();
}

bool ServerRole::is_hosted_here(Endpoint host) const noexcept {
  return host.is_node() && !state_.nodes[host.number()].lost && SharedNodes::is_shared(state_.nodes[host.number()]);
}

// Weighs part by part: the objects of each node of this process, in its Host; all other objects, by slot; the contacts
// of the frame before. An object that changes its place meanwhile may count twice or not at all. Returns whether
// everything has been weighed.
bool ServerRole::weigh(std::size_t most) {
  const std::size_t parts = map_plan_.slots + 2;
  while (most > 0 && map_plan_.part < parts) {
    const std::size_t size = weigh_part(map_plan_.part, 0, 0);
    const std::size_t first = std::min(map_plan_.next, size);
    const std::size_t end = first + std::min(most, size - first);
    weigh_part(map_plan_.part, first, end);
    most -= end - first;
    map_plan_.next = end;
    if (end == size) {
      ++map_plan_.part;
      map_plan_.next = 0;
    }
  }
  return map_plan_.part == parts;
}

// Weighs entries first to end of that part, and returns the size of the part.
std::size_t ServerRole::weigh_part(std::size_t part, std::size_t first, std::size_t end) {
  std::uint32_t point[3];
  const auto add_object_weight = [&](const Vec3d& position) {
    state_.setup.space->point(position, point);
    balance_.add_object_weight(point);
  };
  if (part < map_plan_.slots) {
    const Endpoint node = Endpoint::node(static_cast<NodeNumber>(part));
    if (!is_hosted_here(node)) {
      return 0;
    }
    const Host& host = *SharedNodes::host_of(state_.nodes[part]);
    for (std::size_t i = first; i < end; ++i) {
      if ((host[i].object.flags & messages::flag_present) != 0) {
        add_object_weight(host[i].pose.position);
      }
    }
    return host.size();
  }
  if (part == map_plan_.slots) {
    for (auto slot = static_cast<std::uint32_t>(first); slot < end; ++slot) {
      if (state_.objects.present()[slot] != 0) {
        balance_.add_object_size(state_.objects.bounds()[slot]);
        if (!is_hosted_here(state_.objects.host(slot))) {
          add_object_weight(state_.objects.row(slot).pose.position);
        }
      }
    }
    return state_.objects.slots();
  }
  const auto contacts = state_.ledger.contacts(state_.frame - 1);
  for (std::size_t i = first; i < end; ++i) {
    state_.setup.space->point(contacts[i].point, point);
    balance_.add_contact_weight(point);
  }
  return contacts.size();
}

// Divides the cells by the weights among the nodes that stay; the others hand everything over in this frame. If all
// would leave, all stay, because no node would remain to hand over to.
std::span<const std::uint32_t> ServerRole::partition() {
  state_.list_remaining_nodes(remaining_);
  const bool all_leave = state_.nodes[remaining_.front()].leaving;
  for (PeerSession& session : state_.nodes) {
    session.left = session.leaving && !all_leave;
    session.leaving = false;
  }
  balance_.refine(state_.map, static_cast<std::uint32_t>(remaining_.size()));
  return balance_.partition_for(remaining_);
}

// At the end of a frame: if all nodes that stay were lost after the cells were divided among them, one of those that
// leave stays.
void ServerRole::keep_last_node() noexcept {
  const auto is_there = [](const PeerSession& session) { return session.connected && !session.lost; };
  if (std::any_of(state_.nodes.begin(), state_.nodes.end(),
                  [&](const PeerSession& session) { return is_there(session) && !session.left; })) {
    return;
  }
  const auto first = std::find_if(state_.nodes.begin(), state_.nodes.end(), is_there);
  if (first != state_.nodes.end()) {
    first->left = false;
  }
}

}  // namespace ringfence::nodes
