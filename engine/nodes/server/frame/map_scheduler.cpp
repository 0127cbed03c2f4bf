#include "nodes/server/frame/map_scheduler.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

namespace {

// Cost of a pair in the paper's world, including moving, sweeping and messages. Compared with the cost of a change of
// the map.
constexpr double ms_per_pair = 0.00025;

// Size of a slice: about 0.1 ms of weighing. Larger worlds, whose frames take longer, need no more frames for it. With
// more nodes, which test for a shorter time, slices are smaller.
constexpr std::size_t min_slice = 8192;
constexpr std::size_t min_slices = 8;
constexpr std::size_t nodes_per_slice = 16;

// Frames from the last slice to the new map. To compute it takes about a quarter of the time that one node would need
// for a frame, so with more nodes it takes more frames, until the frames get no shorter.
constexpr std::size_t min_frames = 2;
constexpr std::size_t max_more_frames = 32;
constexpr std::size_t nodes_per_frame = 4;

// Objects or contacts that are prefetched before they are weighed.
constexpr std::size_t prefetch_distance = 8;

}  // namespace

MapScheduler::MapScheduler(ServerState& state, const ServerExchange& exchange, ObjectStates& states)
    : state_(state),
      exchange_(exchange),
      states_(states),
      balance_(state.map.grid(), {}, state.setup.capacities.objects + state.setup.capacities.contacts) {}

double MapScheduler::cost_of(const ServerSetup& setup, const NodeReport& node) noexcept {
  return setup.balance_by == BalanceBy::pairs ? ms_per_pair * static_cast<double>(node.tested) : node.cpu_ms;
}

// Decides whether planning of a new map starts.
void MapScheduler::compare_costs() {
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
  if (plan_.pass == Plan::Pass::none && balance_.needs_new_map()) {
    begin_weights();
  }
}

void MapScheduler::change_map() {
  if (!state_.report().lost.empty()) {
    // The next cut makes a new map. The facade decides again which nodes leave.
    for (PeerSession& session : state_.nodes) {
      session.leaving = false;
    }
    return;
  }
  if (std::exchange(partition_due_, false)) {
    cancel();
    begin_weights();
    weigh(~std::size_t{0});
    const auto table = partition();
    plan_ = {};
    return adopt(table);
  }
  if (plan_.pass == Plan::Pass::planned && is_for_current_map()) {
    adopt(plan_.table);
  }
  if (plan_.pass == Plan::Pass::planned) {
    plan_ = {};
  }
  compare_costs();
}

void MapScheduler::adopt(std::span<const std::uint32_t> table) {
  state_.map.assign(table, static_cast<std::uint32_t>(state_.nodes.size()), state_.map.epoch() + 1);
  balance_.begin_window();
  state_.map_change.at_end = true;
  state_.map_change.hosts_exchange_objects = state_.hosts_send_ghosts();
  if (state_.map_change.hosts_exchange_objects) {
    note_renotified();
  } else {
    states_.store_all();
  }
}

// For objects that are not host-owned the server sends updates when they next move. Then it must know which nodes
// received them now: those whose regions the bounds touch.
void MapScheduler::note_renotified() noexcept {
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.host(slot).is_node() && (state_.objects.marks(slot) & host_owned_mark) == 0) {
      state_.objects.note_notified(slot, state_.objects.bounds(slot), state_.map.grid(), true);
    }
  }
}

bool MapScheduler::plan() {
  using Pass = Plan::Pass;
  if (plan_.pass == Pass::none || plan_.pass == Pass::planned) {
    return false;
  }
  if (!is_for_current_map()) {
    cancel();
    return false;
  }
  if (plan_.pass == Pass::weighing) {
    if (weigh(slice())) {
      state_.list_remaining_nodes(remaining_);
      planner_.start({state_.map, remaining_, state_.hosts_send_ghosts() ? 0 : state_.objects.live()});
      plan_.pass = Pass::computing;
      plan_.frames_left = min_frames + std::min(plan_.slots / nodes_per_frame, max_more_frames);
    }
  } else if (--plan_.frames_left == 0) {
    plan_.table = planner_.take();
    plan_.pass = plan_.table.empty() ? Pass::none : Pass::planned;
  }
  return true;
}

void MapScheduler::cancel() {
  if (planner_.is_started()) {
    planner_.take();
  }
  plan_ = {};
}

std::size_t MapScheduler::slice() const noexcept {
  const std::size_t all = state_.objects.slots() + state_.ledger.contacts(state_.frame - 1).size();
  return std::max(min_slice, all / std::max(min_slices, plan_.slots / nodes_per_slice));
}

bool MapScheduler::is_for_current_map() const noexcept {
  return plan_.epoch == state_.map.epoch() && plan_.slots == state_.nodes.size();
}

void MapScheduler::begin_weights() {
  plan_ = {};
  plan_.pass = Plan::Pass::weighing;
  plan_.epoch = state_.map.epoch();
  plan_.slots = state_.nodes.size();
  balance_.begin_weights();
}

// Whether the objects of the host can be read in its memory.
bool MapScheduler::is_readable(Endpoint host) const noexcept {
  return exchange_.reads_nodes() && host.is_node() && state_.nodes[host.number()].is_active();
}

// Weighs part by part: the objects of each node whose Host can be read; all other objects, by slot; the contacts
// of the frame before. An object that changes its place meanwhile may count twice or not at all. Returns whether
// everything has been weighed.
bool MapScheduler::weigh(std::size_t most) {
  const std::size_t parts = plan_.slots + 2;
  while (most > 0 && plan_.part < parts) {
    const std::size_t size = weigh_part(plan_.part, 0, 0);
    const std::size_t first = std::min(plan_.next, size);
    const std::size_t end = first + std::min(most, size - first);
    weigh_part(plan_.part, first, end);
    most -= end - first;
    plan_.next = end;
    if (end == size) {
      ++plan_.part;
      plan_.next = 0;
    }
  }
  return plan_.part == parts;
}

// Weighs entries first to end of that part, and returns the size of the part.
std::size_t MapScheduler::weigh_part(std::size_t part, std::size_t first, std::size_t end) {
  const ObjectTable& objects = state_.objects;
  std::uint32_t point[3];
  const auto add_object_weight = [&](const Vec3d& position) {
    state_.setup.space->point(position, point);
    balance_.add_object_weight(point);
  };
  if (part < plan_.slots) {
    if (!is_readable(Endpoint::node(static_cast<NodeNumber>(part)))) {
      return 0;
    }
    const Host& host = ServerExchange::host_of(state_.nodes[part]);
    for (std::size_t i = first; i < end; ++i) {
      base::prefetch_object(host[std::min(i + prefetch_distance, end - 1)]);
      if ((host[i].object.flags & messages::flag_present) != 0) {
        add_object_weight(host[i].pose.position);
      }
    }
    return host.size();
  }
  if (part == plan_.slots) {
    for (auto slot = static_cast<std::uint32_t>(first); slot < end; ++slot) {
      if (objects.present()[slot] != 0) {
        balance_.add_object_size(objects.bounds()[slot]);
        if (!is_readable(objects.host(slot))) {
          add_object_weight(objects.row(slot).pose.position);
        }
      }
    }
    return objects.slots();
  }
  const auto contacts = state_.ledger.contacts(state_.frame - 1);
  for (std::size_t i = first; i < end; ++i) {
    base::prefetch_for_read(&contacts[std::min(i + prefetch_distance, end - 1)].point);
    state_.setup.space->point(contacts[i].point, point);
    balance_.add_contact_weight(point);
  }
  return contacts.size();
}

// Divides the cells by the weights among the nodes that stay; the others hand everything over in this frame. If all
// would leave, all stay, because no node would remain to hand over to.
std::span<const std::uint32_t> MapScheduler::partition() {
  state_.list_remaining_nodes(remaining_);
  const bool all_leave = state_.nodes[remaining_.front()].leaving;
  for (PeerSession& session : state_.nodes) {
    session.left = session.leaving && !all_leave;
    session.leaving = false;
  }
  balance_.refine(state_.map, static_cast<std::uint32_t>(remaining_.size()));
  return balance_.partition_for(remaining_);
}

void MapScheduler::finish() noexcept {
  keep_last_node();
  MapChange& change = state_.map_change;
  if (change.at_end) {
    change.updates = change.hosts_exchange_objects ? UpdateScope::not_hosted : UpdateScope::all_objects;
  }
  change.at_end = change.rescan_hosts = change.precedes_frame = false;
}

void MapScheduler::keep_last_node() noexcept {
  const auto is_active = [](const PeerSession& session) { return session.is_active(); };
  const auto stays = [](const PeerSession& session) { return session.is_active() && !session.left; };
  if (std::any_of(state_.nodes.begin(), state_.nodes.end(), stays)) {
    return;
  }
  const auto first = std::find_if(state_.nodes.begin(), state_.nodes.end(), is_active);
  if (first != state_.nodes.end()) {
    first->left = false;
  }
}

}  // namespace ringfence::nodes
