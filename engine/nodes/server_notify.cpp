// The server's last stage: who hosts what in the next frame, and who is told of which contact.
#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/server_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

namespace {

// Moving, sweeping and telling included, of the paper's world. It is set against what a change of the map costs.
constexpr double ms_a_pair = 0.00025;

}  // namespace

// Whether another region map may hold from the next frame on.
bool ServerRole::wants_map() {
  if (!report().lost.empty()) {
    return false;  // the next cut draws the map anew
  }
  if (resize_to_ != 0) {
    return true;
  }
  if (!setup_.balance || map_.nodes() == 1) {
    return false;
  }
  costs_.clear();
  for (const NodeReport& node : reports_[(frame_ + 1) & 1].nodes) {
    const bool by_pairs = setup_.balance_by == BalanceBy::pairs;
    costs_.push_back(by_pairs ? ms_a_pair * static_cast<double>(node.tested) : node.cpu_ms);
  }
  if (costs_.size() == map_.nodes()) {
    balance_.add_frame(costs_);
  }
  return balance_.wanted();
}

// Contacts do not depend on the map, only what the nodes cost.
void ServerRole::draw_map() {
  weigh_cells();
  std::uint32_t nodes = map_.nodes();
  std::span<const std::uint32_t> table;
  if (resize_to_ != 0) {
    nodes = std::exchange(resize_to_, 0u);
    table = share_out(nodes);
  } else {
    table = balance_.propose(map_);
  }
  if (!table.empty()) {
    map_.assign(table, nodes, map_.epoch() + 1);
    map_changed_ = true;
    objects_.forget_kept();  // and so do the nodes
  }
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
    return balance_.share_out(map_, nodes);
  }
  const auto table = balance_.share_out(map_, static_cast<std::uint32_t>(alive_.size()));
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

void ServerRole::weigh_cells() {
  refresh_objects();
  balance_.start_weighing();
  std::uint32_t point[3];
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.present()[slot] != 0) {
      setup_.space->point(objects_.row(slot).pose.position, point);
      balance_.weigh_object(point, objects_.bounds()[slot]);
    }
  }
  ledger_.visit_points([&](const Vec3d& where) {
    setup_.space->point(where, point);
    balance_.weigh_contact(point);
  });
}

// In user/collision deployment hosts follow the poses and the region map. The nodes conclude the same from what they
// hold; here it says to whom contacts go, and how many hand-overs each node has to wait for.
void ServerRole::next_hosts() {
  if (setup_.deployment != Deployment::user_collision) {
    return;
  }
  const auto follow = [&](std::uint32_t slot) {
    const Endpoint host = objects_.host(slot);
    if (!objects_.alive(slot) || !host.is_node()) {
      return;
    }
    const NodeNumber next = hosting_.node_at(objects_.row(slot).pose.position, map_);
    if (host.number() != next) {
      hand_overs_.push_back({slot, host.number(), next});
      objects_.set_host(slot, Endpoint::node(next));
      objects_.marks(slot) |= shared_mark;  // the old host knows it too
      ++nodes_[next].hand_overs;
      ++report().handed_over;
    }
  };
  if (map_changed_ || rescan_hosts_) {
    for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
      follow(slot);
    }
  } else {
    for (const std::uint32_t slot : leaving_) {
      follow(slot);
    }
  }
}

bool ServerRole::send_map(Party& party, messages::RunSender& run) {
  return run.pump(*party.line.out, head(MessageType::region_map, party.self), sizeof(messages::OwnerRecord),
                  report().traffic, [&](std::size_t i, std::byte* where) {
                    const messages::OwnerRecord record{map_.table()[i], 0};
                    std::memcpy(where, &record, sizeof record);
                  });
}

bool ServerRole::notify(Party& party) {
  link::Sender& out = *party.line.out;
  auto& counts = report().traffic;
  const bool node = party.self.is_node();
  if (!tell_to_look(party)) {
    return false;
  }
  if (node && map_changed_ && !send_map(party, party.map_run)) {
    return false;
  }
  if (node && setup_.deployment == Deployment::user_collision && party.line.findings == nullptr &&
      !party.confirm_run.pump(out, head(MessageType::confirm, party.self), sizeof(messages::ConfirmRecord), counts,
                              [&](std::size_t i, std::byte* where) {
                                const messages::ConfirmRecord record{ledger_.persists(party.self.number())[i]};
                                std::memcpy(where, &record, sizeof record);
                              })) {
    return false;
  }
  const bool sent =
      party.notice_run.pump(out, head(MessageType::notify, party.self), sizeof(Contact), counts,
                            [&](std::size_t i, std::byte* where) { write_notice(party.notices[i], where); });
  if (!sent || !node) {
    return sent;
  }
  return party.end_run.pump(out, head(MessageType::frame_end, party.self), sizeof(messages::FrameEndRecord), counts,
                            [&](std::size_t, std::byte* where) {
                              const messages::FrameEndRecord record{party.hand_overs};
                              std::memcpy(where, &record, sizeof record);
                            });
}

}  // namespace ringfence::nodes
