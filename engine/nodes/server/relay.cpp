// State relay: from the user nodes' point of view the server hosts every active and non-active object. Others do most
// of it: in user deployment the user nodes, in user/collision deployment the CD nodes of this process, each for the
// objects that it hosts.
#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

bool ServerRole::relays() const noexcept {
  return state_.setup.interest > 0 && !state_.connected.empty() && state_.setup.deployment != Deployment::user;
}

// With placement region, nodes do not report most states, so they publish themselves. Otherwise few nodes test for
// longer than the server needs to publish all states, so the server's publication costs the frame nothing.
void ServerRole::order_relay() {
  nodes_publish_ =
      relays() && state_.setup.deployment == Deployment::user_collision &&
      (state_.setup.placement == Placement::region || state_.report().nodes.size() > state_.setup.max_relayed_nodes);
  for (PeerSession& node : state_.nodes) {
    order_relay(node);
  }
}

// Before the node's frame begins.
void ServerRole::order_relay(PeerSession& node) {
  if (node.connection.publication != nullptr) {
    node.connection.publication->wanted = nodes_publish_;
  }
}

bool ServerRole::publishes(Endpoint host) const noexcept {
  return nodes_publish_ && host.is_node() && state_.nodes[host.number()].connection.publication != nullptr;
}

// Publishes what no other role publishes: everything, or the objects of nodes in other processes and of lost nodes.
// Repeated in the same frame after a loss, unless user nodes already read: then the lost node had published before,
// too, and its publication holds S(k).
void ServerRole::publish() {
  if (relays_are_final_) {
    relay_is_known_ = false;  // reclaimed objects have moved since
    return;
  }
  Published& relay = state_.setup.publications->server;
  relay.any[state_.frame & 1] = false;
  const bool all_published = nodes_publish_ && !recovered_ &&
                             std::all_of(state_.nodes.begin(), state_.nodes.end(), [&](const PeerSession& node) {
                               return !node.connected || publishes(node.self);
                             });
  if (!relays() || all_published) {
    relay_is_known_ = false;
    return;
  }
  update_relay();
  link::Publication& publication = *relay.publication;
  publication.begin(state_.frame);
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (relay_cells_[slot] != not_relayed && !publishes(state_.objects.host(slot))) {
      publication.add_index(relay_cells_[slot], slot);
    }
  }
  publication.publish_indexed([&](std::uint32_t slot) { base::prefetch_for_read(&state_.objects.row(slot)); },
                              [&](std::uint32_t slot) {
                                const ObjectRow& row = state_.objects.row(slot);
                                return link::PublishedState{row.object.number, 0, row.pose};
                              });
  // Computing the exact range here would cost more than readers lose by searching everywhere.
  relay.cell_range[state_.frame & 1] = state_.setup.publications->grid.all();
  relay.any[state_.frame & 1] = !publication.states(state_.frame).empty();
}

// Updates the cell of every published object; objects that have not moved keep theirs.
void ServerRole::update_relay() {
  const auto update = [&](std::uint32_t slot) {
    const ObjectRow& row = state_.objects.row(slot);
    const auto category = static_cast<Category>(row.category);
    const bool relayed =
        state_.objects.present()[slot] != 0 && (category == Category::active || category == Category::non_active);
    std::uint32_t point[3];
    state_.setup.space->point(row.pose.position, point);
    relay_cells_[slot] = relayed ? state_.setup.publications->grid.cell_of(point) : not_relayed;
  };
  const std::size_t known = std::exchange(relay_is_known_, true) ? relay_cells_.size() : 0;
  relay_cells_.resize(state_.objects.slots());
  for (auto slot = static_cast<std::uint32_t>(known); slot < state_.objects.slots(); ++slot) {
    update(slot);
  }
  constexpr std::size_t ahead = 8;
  const auto moved = state_.objects.moved();
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (i + ahead < moved.size()) {
      base::prefetch_for_read(&state_.objects.row(moved[i + ahead]));
    }
    if (moved[i] < known) {
      update(moved[i]);
    }
  }
}

bool ServerRole::all_published() noexcept {
  return state_.all_nodes([&](const PeerSession& node) { return node.received.published || !publishes(node.self); });
}

// All states are in publications that do not change any more in this frame, so user nodes may read while nodes test. If
// a user's ring is full, the message is sent together with its contacts: the server does not wait here.
void ServerRole::allow_reading() {
  statistics_.charge(Stage::narrow_phase);
  list_relays();
  relays_are_final_ = true;
  if (state_.setup.interest > 0) {
    state_.all_users([&](PeerSession& user) {
      user.closing.read_publications_run.start(0);
      send_read_publications(user);
      return true;
    });
  }
  statistics_.charge_cpu(&PathReport::publish_ms);
  statistics_.charge(Stage::notify);
}

bool ServerRole::send_read_publications(PeerSession& user) {
  return user.closing.read_publications_run.pump(*user.connection.out,
                                                 state_.head(MessageType::read_publications, user.self), 0,
                                                 state_.report().traffic, [](std::size_t, std::byte*) {});
}

// Lists the valid publications; a later loss no longer changes who publishes what.
void ServerRole::list_relays() {
  auto& relays_of_frame = state_.setup.publications->relays[state_.frame & 1];
  relays_of_frame.clear();
  if (!relays()) {
    return;
  }
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(Traffic::state)];
  const auto add_relay = [&](const Published& relay) {
    if (!relay.any[state_.frame & 1]) {
      return;
    }
    relays_of_frame.push_back(&relay);
    const std::size_t states = relay.publication->states(state_.frame).size();
    ++traffic.messages;
    traffic.records += states;
    traffic.bytes += states * sizeof(link::PublishedState);
  };
  add_relay(state_.setup.publications->server);
  for (const PeerSession& node : state_.nodes) {
    if (!node.lost && publishes(node.self)) {
      add_relay(node.connection.publication->published);
    }
  }
}

}  // namespace ringfence::nodes
