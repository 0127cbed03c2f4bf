#include "nodes/server/frame/state_relay.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

StateRelay::StateRelay(ServerState& state, const ServerExchange& exchange) : state_(state), exchange_(exchange) {
  listed_.reserve(state.setup.capacities.objects);
}

// With placement region, nodes do not report most states, so they publish themselves. Otherwise few nodes test for
// longer than the server needs to publish all states, so the server's publication costs the frame nothing.
void StateRelay::begin() {
  is_final_ = false;
  nodes_publish_ =
      is_needed() && state_.nodes_host() && exchange_.reads_nodes() &&
      (state_.setup.placement == Placement::region || state_.report().nodes.size() > state_.setup.max_relayed_nodes);
  const auto prefetch = [](const PeerSession& node) { base::prefetch_for_write(node.connection.publication); };
  state_.all_nodes(prefetch, [this](PeerSession& node) {
    order(node);
    return true;
  });
}

void StateRelay::order(PeerSession& node) const noexcept {
  if (node.connection.publication != nullptr) {
    node.connection.publication->wanted = nodes_publish_;
  }
}

void StateRelay::publish(bool holds_lost_objects) {
  if (is_final_) {
    list_is_known_ = false;  // reclaimed objects have moved since
    return;
  }
  Published& relay = state_.setup.publications->server;
  relay.any[state_.frame & 1] = false;
  if (!is_needed() || (nodes_publish_ && !holds_lost_objects)) {
    list_is_known_ = false;
    return;
  }
  list_objects();
  const ObjectTable& objects = state_.objects;
  Publication& publication = *relay.publication;
  publication.begin(state_.frame);
  publication.publish([&](std::uint32_t slot) { base::prefetch_for_read(&objects.row(slot)); },
                      [&](std::uint32_t slot, PublishedState& to) {
                        if (!is_relayed(slot)) {
                          listed_[slot] = 0;
                          return Publication::Written::unlisted;
                        }
                        if (nodes_publish_ && objects.host(slot).is_node()) {
                          return Publication::Written::nothing;
                        }
                        const ObjectRow& row = objects.row(slot);
                        to = {row.object.number, 0, row.pose};
                        return Publication::Written::state;
                      });
  note_published(relay, state_.frame);
}

// Lists the slots of objects that are published. An object that has come to a slot or that is present again is among
// those that moved. The publication removes the others.
void StateRelay::list_objects() {
  const ObjectTable& objects = state_.objects;
  const auto list = [&](std::uint32_t slot) {
    if (listed_[slot] == 0 && is_relayed(slot)) {
      listed_[slot] = 1;
      state_.setup.publications->server.publication->list(slot);
    }
  };
  const auto known = static_cast<std::uint32_t>(listed_.size());
  listed_.resize(objects.slots());
  std::fill(listed_.begin() + known, listed_.end(), std::uint8_t{0});
  for (std::uint32_t slot = std::exchange(list_is_known_, true) ? known : 0; slot < objects.slots(); ++slot) {
    list(slot);
  }
  for (const std::uint32_t slot : objects.moved()) {
    list(slot);
  }
}

void StateRelay::allow_reading() {
  list_publications();
  is_final_ = true;
  if (state_.setup.interest > 0) {
    for (UserConnection& peers : state_.user_connections) {
      peers.read_publications_run.start(0);
      send_read_publications(peers);
    }
  }
}

// Lists the valid publications; a later loss no longer changes who publishes what.
void StateRelay::list_publications() {
  auto& relays_of_frame = state_.setup.publications->relays[state_.frame & 1];
  relays_of_frame.clear();
  const auto list = [&](const Published& relay) {
    const bool any = relay.any[state_.frame & 1];
    if (any) {
      relays_of_frame.push_back(&relay);
    }
    return any;
  };
  const auto list_relay = [&](const Published& relay) {
    if (list(relay)) {
      count(relay);
    }
  };
  if (is_needed()) {
    list_relay(state_.setup.publications->server);
  }
  for (const PeerSession& node : state_.nodes) {
    if (is_needed() && node.is_active() && nodes_publish_) {
      list_relay(node.connection.publication->published);
    }
  }
  for (const UserConnection& peers : state_.user_connections) {
    if (peers.published) {
      list(peers.connection.publication->published);  // counted as M1
    }
  }
}

void StateRelay::count(const Published& relay) noexcept {
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(Traffic::state)];
  const std::size_t states = relay.publication->states(state_.frame).size();
  ++traffic.messages;
  traffic.records += states;
  traffic.bytes += states * sizeof(PublishedState);
}

}  // namespace ringfence::nodes
