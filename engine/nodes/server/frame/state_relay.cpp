#include "nodes/server/frame/state_relay.hpp"

#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

StateRelay::StateRelay(ServerState& state, const ServerExchange& exchange) : state_(state), exchange_(exchange) {
  cells_.reserve(state.setup.capacities.objects);
}

// With placement region, nodes do not report most states, so they publish themselves. Otherwise few nodes test for
// longer than the server needs to publish all states, so the server's publication costs the frame nothing.
void StateRelay::begin() {
  is_final_ = false;
  nodes_publish_ =
      is_needed() && state_.nodes_host() && exchange_.reads_nodes() &&
      (state_.setup.placement == Placement::region || state_.report().nodes.size() > state_.setup.max_relayed_nodes);
  for (PeerSession& node : state_.nodes) {
    order(node);
  }
}

void StateRelay::order(PeerSession& node) const noexcept {
  if (node.connection.publication != nullptr) {
    node.connection.publication->wanted = nodes_publish_;
  }
}

void StateRelay::publish(bool holds_lost_objects) {
  if (is_final_) {
    cells_are_known_ = false;  // reclaimed objects have moved since
    return;
  }
  Published& relay = state_.setup.publications->server;
  relay.any[state_.frame & 1] = false;
  if (!is_needed() || (nodes_publish_ && !holds_lost_objects)) {
    cells_are_known_ = false;
    return;
  }
  update_cells();
  const ObjectTable& objects = state_.objects;
  link::Publication& publication = *relay.publication;
  publication.begin(state_.frame);
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    if (cells_[slot] != not_relayed && !(nodes_publish_ && objects.host(slot).is_node())) {
      publication.add_index(cells_[slot], slot);
    }
  }
  publication.publish_indexed([&](std::uint32_t slot) { base::prefetch_for_read(&objects.row(slot)); },
                              [&](std::uint32_t slot) {
                                const ObjectRow& row = objects.row(slot);
                                return link::PublishedState{row.object.number, 0, row.pose};
                              });
  // Computing the exact range here would cost more than readers lose by searching everywhere.
  relay.cell_range[state_.frame & 1] = state_.setup.publications->grid.all();
  relay.any[state_.frame & 1] = !publication.states(state_.frame).empty();
}

// Updates the cell of every published object; objects that have not moved keep theirs, and so do those whose position
// was noted.
void StateRelay::update_cells() {
  const ObjectTable& objects = state_.objects;
  const auto update = [&](std::uint32_t slot) {
    const ObjectRow& row = objects.row(slot);
    const auto category = static_cast<Category>(row.category);
    const bool relayed =
        objects.present()[slot] != 0 && (category == Category::active || category == Category::non_active);
    cells_[slot] = relayed ? cell_of(row.pose.position) : not_relayed;
  };
  const std::size_t known = std::exchange(cells_are_known_, true) ? cells_.size() : 0;
  cells_.resize(objects.slots());
  for (auto slot = static_cast<std::uint32_t>(known); slot < objects.slots(); ++slot) {
    update(slot);
  }
  constexpr std::size_t ahead = 8;
  const auto is_stale = [&](std::uint32_t slot) { return (objects.marks(slot) & cell_noted_mark) == 0; };
  const auto moved = objects.moved();
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (i + ahead < moved.size() && is_stale(moved[i + ahead])) {
      base::prefetch_for_read(&objects.row(moved[i + ahead]));
    }
    if (moved[i] < known && is_stale(moved[i])) {
      update(moved[i]);
    }
  }
}

bool StateRelay::is_ready() noexcept {
  return !is_final_ && state_.users_have_published() &&
         state_.all_nodes([&](const PeerSession& node) { return node.received.published || !nodes_publish_; });
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
  traffic.bytes += states * sizeof(link::PublishedState);
}

}  // namespace ringfence::nodes
