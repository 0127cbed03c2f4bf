// What becomes of the frame when a CD node stops answering, and of user nodes that miss their deadline.
//
// The server holds S(k-1) of every object and C(k-1) of the frame before, and each S(k) that it has been told is final.
// So a node that is lost before the contacts are known costs nobody anything but time: its cells go to the others, the
// server moves those of its objects that it had not reported, and the frame is detected again under the new map, with a
// new epoch by which what was found under the old one is refused. A node that is lost afterwards leaves objects only:
// the server takes them back, and what was on its way to or from the node. At the next cut the nodes close ranks, and
// every object that the server holds is given to the node whose region it stands in, with its contacts.
#include <algorithm>
#include <cstring>

#include "nodes/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

bool ServerRole::lose(NodeNumber node) {
  if (stage_ == Stage::waiting) {
    return false;
  }
  Party& party = nodes_[node];
  if (party.lost) {
    return true;
  }
  party.lost = true;
  bar_from_halos();
  node_lines_[node] = {};
  report().lost.push_back(node);
  const bool again = !is_telling();
  bool any_left = false;
  for (Party& other : nodes_) {
    if (!other.lost) {
      any_left = true;
      other.losses.push_back({node, again ? 1u : 0u, 0});
      other.lost_run.start(other.losses.size());
    }
  }
  losses_to_tell_ = true;
  if (!again) {
    ledger_.lose(node);
    forgo_hand_overs(node);
    return true;
  }
  spread_cells();
  rescue_objects(node);
  detect_again();
  if (!any_left) {
    stand_in_for_ = node;
    setup_.order->stand_in_for = node;
    setup_.order->stand_in_wanted.store(true, std::memory_order_release);
    if (setup_.order->caller != nullptr) {
      setup_.order->caller->ring();
    }
  }
  return true;
}

// In stretches, so that what was one region becomes few. Where nobody is left, the last one's stand-in gets all.
void ServerRole::spread_cells() {
  alive_.clear();
  for (const Party& party : nodes_) {
    if (!party.lost) {
      alive_.push_back(party.self.number());
    }
  }
  table_.assign(map_.table().begin(), map_.table().end());
  const auto orphan = [&](std::uint32_t entry) { return !regions::RegionMap::is_cut(entry) && nodes_[entry].lost; };
  const auto orphans = static_cast<std::size_t>(std::count_if(table_.begin(), table_.end(), orphan));
  std::size_t passed = 0;
  for (std::uint32_t& entry : table_) {
    if (orphan(entry)) {
      entry = alive_.empty() ? report().lost.back() : alive_[passed * alive_.size() / orphans];
      ++passed;
    }
  }
  map_.assign(table_, static_cast<std::uint32_t>(nodes_.size()), map_.epoch() + 1);
  if (resize_to_ >= nodes_.size()) {
    resize_to_ = 0;  // the nodes that were to join have joined
  }
}

// Of a node that is lost, whose thread may be late rather than dead: what it does not write any more.
void ServerRole::read_kept(NodeNumber node, std::uint64_t frame) {
  const Party& party = nodes_[node];
  if (party.line.findings == nullptr) {
    return;
  }
  const KeptStates& kept = party.line.findings->kept;
  const std::span<const KeptState> states = kept.of(frame);
  for (std::size_t i = 0; i < states.size(); ++i) {
    take_in(party, frame, states[i].object, states[i].pose, kept.state(frame, i));
  }
}

void ServerRole::take_back(std::uint32_t slot) {
  objects_.set_host(slot, Endpoint::server());
  objects_.marks(slot) = static_cast<ObjectMarks>((objects_.marks(slot) & ~kept_mark) | rescued_mark);
  rescued_ = true;
}

void ServerRole::rescue_objects(NodeNumber node) {
  const Endpoint gone = Endpoint::node(node);
  while (rescue_.size() != 0) {
    rescue_.drop(rescue_[0].object.number);
  }
  read_kept(node, frame_ - 1);
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (!objects_.alive(slot) || objects_.host(slot) != gone) {
      continue;
    }
    take_back(slot);
    if ((objects_.marks(slot) & reported_mark) == 0) {
      rescue_.adopt(objects_.hand_over(slot), objects_.state(slot));
    }
  }
  rescue_.begin_contacts(frame_ - 1);
  for (const Contact& contact : ledger_.contacts(frame_ - 1)) {
    if (rescue_.find(contact.a) != NumberIndex::none || rescue_.find(contact.b) != NumberIndex::none) {
      rescue_.add_contact(frame_ - 1, contact);
    }
  }
  rescue_.move(frame_);
  take_moves(rescue_);
}

void ServerRole::detect_again() {
  if (stage_ == Stage::dispatching || stage_ == Stage::colliding) {
    stage_ = Stage::moving;
  }
  ledger_.begin(frame_);
  FrameReport& frame = report();
  frame.candidates = frame.tested = frame.accepted = 0;
  for (NodeReport& node : frame.nodes) {
    node = {};
  }
  for (Party& party : nodes_) {
    party.tested_heard = false;
    party.new_map_run.start(map_.table().size());
  }
  telling_ = Dispatch::Telling::everything;
  rescan_hosts_ = true;
}

// Contacts are known. What the node was to give to others will not come, or has come and is given again at the cut.
void ServerRole::forgo_hand_overs(NodeNumber node) {
  read_kept(node, frame_);
  for (const HandOver& change : hand_overs_) {
    Party& to = nodes_[change.to];
    if (change.from != node || to.lost) {
      continue;
    }
    if (to.end_run.done()) {
      ++to.losses.back().hand_overs;
    } else {
      --to.hand_overs;
    }
    to.drops.push_back(change.slot);
    take_back(change.slot);
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.alive(slot) && objects_.host(slot) == Endpoint::node(node)) {
      take_back(slot);
    }
  }
}

bool ServerRole::tell_losses() {
  if (stand_in_for_ != no_node && !meet_stand_in()) {
    return false;
  }
  bool all = true;
  for (Party& party : nodes_) {
    all &= party.lost || tell_losses(party);
  }
  losses_to_tell_ = !all;
  return all;
}

bool ServerRole::tell_losses(Party& party) {
  if (!party.losses.empty()) {
    const bool sent = party.lost_run.pump(
        *party.line.out, head(MessageType::lost, party.self), sizeof(messages::LostRecord), report().traffic,
        [&](std::size_t i, std::byte* where) { std::memcpy(where, &party.losses[i], sizeof party.losses[i]); });
    if (!sent) {
      return false;
    }
    party.losses.clear();
  }
  if (!party.new_map_run.done() && !send_map(party, party.new_map_run)) {
    return false;
  }
  // A stand-in joins a frame that the others have begun.
  return stage_ == Stage::opening || party.begin_run.pump(*party.line.out, head(MessageType::frame_begin, party.self),
                                                          0, report().traffic, [](std::size_t, std::byte*) {});
}

// The last node is lost and the contacts are not known: the facade makes another, which the server's thread steps.
bool ServerRole::meet_stand_in() {
  FrameOrder& order = *setup_.order;
  if (!order.stand_in_ready.load(std::memory_order_acquire)) {
    return false;
  }
  order.stand_in_ready.store(false, std::memory_order_relaxed);
  Party& party = nodes_[stand_in_for_];
  party = {};
  party.self = Endpoint::node(stand_in_for_);
  party.line = order.stand_in;
  party.connected = true;
  party.heard_ns = telemetry::now_ns();
  party.begin_run.start(0);
  order_relay(party);
  node_lines_[stand_in_for_] = party.line;
  stand_in_for_ = no_node;
  return true;
}

// At the cut: the nodes that are left are numbered anew, from 0 and in order, as the facade does too.
void ServerRole::close_ranks() {
  const auto is_gone = [](const Party& party) { return party.lost || party.left; };
  if (std::none_of(nodes_.begin(), nodes_.end(), is_gone)) {
    return;
  }
  alive_.assign(nodes_.size(), no_node);  // new numbers by old
  NodeNumber left = 0;
  std::uint32_t in_map = 0;
  for (NodeNumber node = 0; node < nodes_.size(); ++node) {
    if (!is_gone(nodes_[node])) {
      alive_[node] = left++;
      in_map += node < map_.nodes() ? 1 : 0;
    }
  }
  table_.assign(map_.table().begin(), map_.table().end());
  for (std::size_t i = 0; i < table_.size(); ++i) {
    if (!regions::RegionMap::is_cut(table_[i])) {
      const NodeNumber number = alive_[table_[i]];
      table_[i] = number != no_node ? number : static_cast<NodeNumber>(i * in_map / table_.size());
    }
  }
  map_.assign(table_, std::max(1u, in_map), map_.epoch() + 1);
  std::erase_if(nodes_, is_gone);
  node_lines_.clear();
  for (NodeNumber node = 0; node < left; ++node) {
    nodes_[node].self = Endpoint::node(node);
    node_lines_.push_back(nodes_[node].line);
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    const Endpoint host = objects_.host(slot);
    if (host.is_node()) {
      objects_.set_host(slot, Endpoint::node(alive_[host.number()]));
    }
  }
  dispatch_.resize(left);
  ledger_.resize(left);
  resize_to_ = std::min(resize_to_, left);
  telling_ = Dispatch::Telling::everything;
  rescan_hosts_ = map_first_ = true;
}

void ServerRole::restore_objects() {
  if (!rescued_) {
    return;
  }
  const auto is_rescued = [&](std::uint32_t slot) {
    return objects_.alive(slot) && (objects_.marks(slot) & rescued_mark) != 0;
  };
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (is_rescued(slot)) {
      const NodeNumber node = hosting_.node_at(objects_.row(slot).pose.position, map_);
      objects_.set_host(slot, Endpoint::node(node));
      nodes_[node].adoptions.push_back(slot);
      ++report().handed_over;
    }
  }
  const auto contacts = ledger_.contacts(frame_ - 1);
  const auto found = ledger_.found(frame_ - 1);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Endpoint first = objects_.host(found[i].a);
    const Endpoint second = objects_.host(found[i].b);
    const bool to_first = is_rescued(found[i].a);
    if (to_first) {
      nodes_[first.number()].late_contacts.push_back(contacts[i]);
    }
    if (is_rescued(found[i].b) && !(to_first && first == second)) {
      nodes_[second.number()].late_contacts.push_back(contacts[i]);
    }
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    objects_.marks(slot) &= static_cast<ObjectMarks>(~rescued_mark);
  }
  rescued_ = false;
}

// What comes from a lost node comes too late, whatever it is.
bool ServerRole::drain_lost(Party& party) {
  bool any = false;
  for (auto bytes = party.line.in->next(); !bytes.empty(); bytes = party.line.in->next()) {
    refuse(Status::late);
    any = true;
  }
  if (any) {
    party.line.in->release();
  }
  return any;
}

// Called when the frame does not get on. Whether that has changed.
bool ServerRole::watch() {
  if (stage_ == Stage::waiting || (setup_.node_deadline_ns == 0 && setup_.user_deadline_ns == 0)) {
    return false;
  }
  const std::uint64_t now = telemetry::now_ns();
  bool changed = false;
  for (Party& party : nodes_) {
    changed |= setup_.node_deadline_ns != 0 && !party.lost && watch_node(party, now);
  }
  for (const UserNumber user : connected_) {
    Party& party = users_[user];
    changed |= setup_.user_deadline_ns != 0 && !party.lost && watch_user(party, now);
  }
  return changed;
}

// Silence alone proves nothing: a node may wait for one that is lost. So it is asked, and has as long again to answer.
bool ServerRole::watch_node(Party& party, std::uint64_t now) {
  const std::uint64_t silent = now - std::min(now, party.heard_ns);
  if (silent <= setup_.node_deadline_ns / 2) {
    return false;
  }
  if (party.probed_ns == 0) {
    party.probed_ns = now;
    party.probe_run.start(0);
  }
  if (stage_ == Stage::dispatching) {
    dispatch_.flush(party.self.number(), party.line, head(MessageType::pairs, party.self), report().traffic);
  }
  party.probe_run.pump(*party.line.out, head(MessageType::probe, party.self), 0, report().traffic,
                       [](std::size_t, std::byte*) {});
  if (now - party.probed_ns <= setup_.node_deadline_ns / 2) {
    return false;
  }
  lose(party.self.number());
  return true;
}

bool ServerRole::watch_user(Party& party, std::uint64_t now) {
  if (stage_ == Stage::opening) {
    return false;  // it has not been told to move
  }
  const bool awaited = is_telling() ? !party.told_heard : !party.states_heard;
  const std::uint64_t since = is_telling() ? notify_ns_ : begin_ns_;
  if (!awaited || now - since <= setup_.user_deadline_ns) {
    return false;
  }
  party.lost = true;
  report().late.push_back(party.self.number());
  refuse(Status::late);
  return true;
}

}  // namespace ringfence::nodes
