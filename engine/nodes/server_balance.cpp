// How the server draws region maps: regions follow the load, and more or fewer nodes share the world out anew.
//
// Contacts do not depend on the map, only what the nodes cost. A map is drawn over several frames, a step in each,
// while the nodes test and the server would wait: first what stands and collides where is weighed, so much of it a
// frame, then cells are cut, then shared out. Only where the number of nodes changes all is done at once.
#include <algorithm>
#include <utility>

#include "nodes/server_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

namespace {

// Moving, sweeping and telling included, of the paper's world. It is set against what a change of the map costs.
constexpr double ms_a_pair = 0.00025;

// A slice of what is weighed: some 0.1 ms, and larger worlds, whose frames take longer, in no more frames for it.
constexpr std::size_t least_weighed = 8192;
constexpr std::size_t frames_of_weighing = 8;

}  // namespace

// At the end of a frame: whether another map is to be drawn from now on.
void ServerRole::judge_costs() {
  if (!setup_.balance || map_.nodes() == 1) {
    return;
  }
  costs_.clear();
  for (const NodeReport& node : reports_[(frame_ + 1) & 1].nodes) {
    const bool by_pairs = setup_.balance_by == BalanceBy::pairs;
    costs_.push_back(by_pairs ? ms_a_pair * static_cast<double>(node.tested) : node.cpu_ms);
  }
  if (costs_.size() == map_.nodes()) {
    balance_.add_frame(costs_);
  }
  if (drawing_.pass == Drawing::Pass::none && balance_.wanted()) {
    start_weighing();
  }
}

// At the end of a frame: another map from the next frame on, if one is due.
void ServerRole::change_map() {
  if (!report().lost.empty()) {
    return;  // the next cut draws the map anew
  }
  if (resize_to_ != 0) {
    std::uint32_t nodes = std::exchange(resize_to_, 0u);
    start_weighing();
    weigh(~std::size_t{0});
    const auto table = share_out(nodes);
    drawing_ = {};
    return take_map(table, nodes);
  }
  if (drawing_.pass == Drawing::Pass::drawn && is_for_this_map(drawing_)) {
    take_map(drawing_.table, map_.nodes());
  }
  if (drawing_.pass == Drawing::Pass::drawn) {
    drawing_ = {};
  }
  judge_costs();
}

void ServerRole::take_map(std::span<const std::uint32_t> table, std::uint32_t nodes) {
  map_.assign(table, nodes, map_.epoch() + 1);
  map_changed_ = true;
  hosts_tell_ = can_hosts_tell();
  if (hosts_tell_) {
    note_retold();
  } else {
    refresh_objects();
  }
}

// Whether under a new map each node can tell the others what it hosts, what rests included, in place of the server.
bool ServerRole::can_hosts_tell() const noexcept {
  return setup_.placement == Placement::region && setup_.deployment == Deployment::user_collision &&
         std::all_of(nodes_.begin(), nodes_.end(), [&](const Party& party) {
           return party.line.findings != nullptr && (setup_.interest <= 0 || party.line.publication != nullptr);
         });
}

// What hosts do not keep to themselves the server tells of again when it next moves, and then has to know who knew it:
// those whose regions its bounds touch.
void ServerRole::note_retold() noexcept {
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.host(slot).is_node() && (objects_.marks(slot) & kept_mark) == 0) {
      note_told(slot, objects_.bounds(slot), true);
    }
  }
}

// While the nodes test: their objects stand still and are theirs until the frame's end.
void ServerRole::draw_map() {
  using Pass = Drawing::Pass;
  if (drawing_.pass == Pass::none || drawing_.pass == Pass::drawn) {
    return;
  }
  if (!is_for_this_map(drawing_)) {
    drawing_ = {};
    return;
  }
  switch (drawing_.pass) {
    case Pass::weighing: {
      const std::size_t all = objects_.slots() + ledger_.contacts(frame_ - 1).size();
      drawing_.pass = weigh(std::max(least_weighed, all / frames_of_weighing)) ? Pass::refining : Pass::weighing;
      break;
    }
    case Pass::refining:
      balance_.refine(map_, map_.nodes());
      drawing_.pass = Pass::sharing;
      break;
    case Pass::sharing:
      drawing_.table = balance_.propose(map_, can_hosts_tell() ? 0 : objects_.live());
      drawing_.pass = drawing_.table.empty() ? Pass::none : Pass::drawn;
      break;
    case Pass::none:
    case Pass::drawn:
      break;
  }
  spend_cpu(&PathReport::draw_ms);
}

bool ServerRole::is_for_this_map(const Drawing& drawing) const noexcept {
  return drawing.epoch == map_.epoch() && drawing.nodes == nodes_.size();
}

void ServerRole::start_weighing() {
  drawing_ = {};
  drawing_.pass = Drawing::Pass::weighing;
  drawing_.epoch = map_.epoch();
  drawing_.nodes = nodes_.size();
  balance_.start_weighing();
}

bool ServerRole::is_hosted_here(Endpoint host) const noexcept {
  return host.is_node() && !nodes_[host.number()].lost && nodes_[host.number()].line.findings != nullptr;
}

// Part by part: the objects of each node of this process, where the node has them; all others, by slot; the contacts of
// the frame before. What changes place meanwhile may count twice, or not at all. Whether all has been weighed.
bool ServerRole::weigh(std::size_t most) {
  const std::size_t parts = drawing_.nodes + 2;
  while (most > 0 && drawing_.part < parts) {
    const std::size_t size = weigh_part(drawing_.part, 0, 0);
    const std::size_t first = std::min(drawing_.next, size);
    const std::size_t end = first + std::min(most, size - first);
    weigh_part(drawing_.part, first, end);
    most -= end - first;
    drawing_.next = end;
    if (end == size) {
      ++drawing_.part;
      drawing_.next = 0;
    }
  }
  return drawing_.part == parts;
}

// Weighs what is from first to end in that part, and says how large the part is.
std::size_t ServerRole::weigh_part(std::size_t part, std::size_t first, std::size_t end) {
  std::uint32_t point[3];
  const auto weigh_object = [&](const Vec3d& position) {
    setup_.space->point(position, point);
    balance_.weigh_object(point);
  };
  if (part < drawing_.nodes) {
    const Endpoint node = Endpoint::node(static_cast<NodeNumber>(part));
    if (!is_hosted_here(node)) {
      return 0;
    }
    const Host& host = *nodes_[part].line.findings->host;
    for (std::size_t i = first; i < end; ++i) {
      if ((host[i].object.flags & messages::flag_present) != 0) {
        weigh_object(host[i].pose.position);
      }
    }
    return host.size();
  }
  if (part == drawing_.nodes) {
    for (auto slot = static_cast<std::uint32_t>(first); slot < end; ++slot) {
      if (objects_.present()[slot] != 0) {
        balance_.size_object(objects_.bounds()[slot]);
        if (!is_hosted_here(objects_.host(slot))) {
          weigh_object(objects_.row(slot).pose.position);
        }
      }
    }
    return objects_.slots();
  }
  const auto contacts = ledger_.contacts(frame_ - 1);
  for (std::size_t i = first; i < end; ++i) {
    setup_.space->point(contacts[i].point, point);
    balance_.weigh_contact(point);
  }
  return contacts.size();
}

// By what stands and collides where. Nodes that leave get nothing, whatever their numbers; then all keep their numbers
// until the next cut.
std::span<const std::uint32_t> ServerRole::share_out(std::uint32_t& nodes) {
  alive_.clear();
  for (const Party& party : nodes_) {
    if (!party.leaving) {
      alive_.push_back(party.self.number());
    }
  }
  if (alive_.empty() || alive_.size() == nodes_.size()) {
    for (Party& party : nodes_) {
      party.leaving = false;  // nobody is left to give anything to
    }
    balance_.refine(map_, nodes);
    return balance_.share_out(nodes);
  }
  const auto stay = static_cast<std::uint32_t>(alive_.size());
  balance_.refine(map_, stay);
  const auto table = balance_.share_out(stay);
  table_.assign(table.begin(), table.end());
  for (std::uint32_t& entry : table_) {
    entry = regions::RegionMap::is_cut(entry) ? entry : alive_[entry];
  }
  for (Party& party : nodes_) {
    party.left = party.leaving;
  }
  nodes = static_cast<std::uint32_t>(nodes_.size());
  return table_;
}

}  // namespace ringfence::nodes
