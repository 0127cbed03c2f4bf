#include "nodes/test_harness.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <doctest/doctest.h>

namespace ringfence::nodes::test {

bool TappedChannel::pass(const Tamper& tamper, std::vector<LoggedMessage>& log, std::size_t most) {
  bool any = false;
  for (std::size_t passed = 0; passed < most; ++passed) {
    const auto bytes = near_.receiver().next();
    if (bytes.empty()) {
      break;
    }
    any = true;
    LoggedMessage seen{from_, to_, {}, {bytes.begin(), bytes.end()}};
    REQUIRE(bytes.size() >= sizeof(messages::Header));
    std::memcpy(&seen.header, bytes.data(), sizeof seen.header);
    std::vector<std::vector<std::byte>> instead{seen.bytes};
    if (tamper) {
      tamper(seen, instead);
    }
    for (const auto& message : instead) {
      forge(message);
    }
    log.push_back(std::move(seen));
  }
  if (any) {
    near_.receiver().release();
  }
  return any;
}

void TappedChannel::forge(std::span<const std::byte> message) {
  const auto room = far_.sender().claim(message.size());
  REQUIRE(room.size() == message.size());
  std::copy(message.begin(), message.end(), room.begin());
  far_.sender().commit(message.size());
  far_.sender().publish();
}

TestHarness::TestHarness(const HarnessConfig& config)
    : config_(config), map_(config.grid, config.nodes), relay_(config.grid.cells(), 16) {
  publications_.grid = config.grid;
  publications_.space = &space_;
  publications_.server.publication = &relay_;
  ServerSetup setup;
  setup.shapes = &shapes_;
  setup.space = &space_;
  setup.model = config.model;
  setup.publications = &publications_;
  setup.order = &order_;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.layer_masks.fill(~0u);
  setup.capacities = {16, 16, 16, 4};
  setup.interest = config.interest;
  setup.max_relayed_nodes = 0;
  setup.quotas = config.quotas;
  setup.user_deadline_ns = config.user_deadline_ns;
  setup.node_deadline_ns = config.node_deadline_ns;
  for (NodeNumber node = 0; node < config.nodes; ++node) {
    active_.push_back(node);
    setup.nodes.push_back(add_node(node));
  }
  connect_peers();
  server_.emplace(setup, map_);
}

Connection TestHarness::add_node(NodeNumber number) {
  Node& node = nodes_.emplace_back();
  node.in = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::server(),
                                            Endpoint::node(number));
  node.out = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::node(number),
                                             Endpoint::server());
  CdNodeSetup own;
  own.node = number;
  own.shapes = &shapes_;
  own.space = &space_;
  own.model = config_.model;
  own.placement = config_.placement;
  own.layer_masks.fill(~0u);
  if (config_.shares_memory) {
    node.node_contacts = std::make_unique<NodeContacts>();
    if (config_.deployment == Deployment::user_collision && config_.interest > 0) {
      if (config_.all_publish || number % 2 == 0) {
        node.publication = std::make_unique<NodePublication>(config_.grid, 16);
      } else {
        own.keeps_host_owned_states = false;
      }
    }
  }
  own.interest_grid = config_.grid;
  own.server = {&node.out->sender(), &node.in->receiver(), node.node_contacts.get(), node.publication.get()};
  own.peers.resize(std::max<std::size_t>(config_.nodes, number + 1));
  node.role = std::make_unique<CdNodeRole>(own, server_ ? server_->map() : map_);
  return {&node.in->sender(), &node.out->receiver(), node.node_contacts.get(), node.publication.get()};
}

// Gives every node its connections to the others, by their current numbers.
void TestHarness::connect_peers() {
  for (NodeNumber p = 0; p < active_.size(); ++p) {
    std::vector<Connection> peers(active_.size());
    for (NodeNumber q = 0; q < active_.size(); ++q) {
      if (p == q) {
        continue;
      }
      for (const auto& [from, to] : {std::pair(p, q), std::pair(q, p)}) {
        auto& channel = peers_[{active_[from], active_[to]}];
        if (channel == nullptr) {
          channel = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::node(from),
                                                    Endpoint::node(to));
        }
      }
      peers[q] = {&peers_[{active_[p], active_[q]}]->sender(), &peers_[{active_[q], active_[p]}]->receiver(),
                  nodes_[active_[q]].node_contacts.get()};
    }
    nodes_[active_[p]].role->assign(p, peers);
  }
}

void TestHarness::kill(NodeNumber node, std::size_t messages) { nodes_[active_[node]].messages = messages; }

void TestHarness::stop_inside(NodeNumber node, GateOf gate) {
  Node& stopping = nodes_[active_[node]];
  stopping.stops_inside =
      gate == GateOf::ghost_updates ? &stopping.node_contacts->ghost_updates.gate : &stopping.node_contacts->gate;
}

// Passes messages between a node and the server until the node stops.
bool TestHarness::pass(Node& node) {
  const std::size_t before = log_.size();
  const bool from_node = node.out->pass(tamper_nodes, log_);
  const bool delivered = node.in->pass({}, log_);
  if (node.messages != ~std::size_t{0}) {
    node.messages -= std::min(node.messages, log_.size() - before);
  }
  return from_node || delivered;
}

bool TestHarness::lose(NodeNumber number, bool still_runs) {
  if (!server_->lose(number)) {
    return false;  // it has not begun the frame
  }
  Node& node = nodes_[active_[number]];
  node.stopped_role = std::move(node.role);
  node.still_runs = still_runs;
  return true;
}

// Nothing progresses because of the stopped nodes; reports the first of them as lost.
void TestHarness::report_stopped_nodes() {
  for (NodeNumber number = 0; number < active_.size(); ++number) {
    Node& node = nodes_[active_[number]];
    if (node.role != nullptr && node.messages == 0) {
      lose(number, false);
      return;
    }
  }
  // Only a node that has stopped inside a gate may make the frame wait, until its deadline.
  REQUIRE(std::any_of(nodes_.begin(), nodes_.end(), [](const Node& node) { return node.stops_inside != nullptr; }));
  REQUIRE(std::chrono::steady_clock::now() - frame_began_ < std::chrono::seconds(20));
}

// As World does when a frame begins.
void TestHarness::grow() {
  if (resize_to_ == 0) {
    return;
  }
  Request request;
  request.kind = Request::Kind::add_node;
  while (active_.size() < resize_to_) {
    const auto number = static_cast<NodeNumber>(active_.size());
    active_.push_back(nodes_.size());
    request.connection = add_node(number);
    requests_.push_back(request);
  }
  connect_peers();
  request.kind = Request::Kind::resize;
  request.nodes = std::exchange(resize_to_, 0u);
  requests_.push_back(request);
}

// The frame is over: renumbers the remaining nodes in order, as the server does at its next cut.
void TestHarness::retire_lost() {
  const auto in_map = static_cast<std::ptrdiff_t>(std::min<std::size_t>(server_->map().nodes(), active_.size()));
  const auto is_active = [&](std::size_t node) { return nodes_[node].role != nullptr; };
  const auto left = static_cast<std::size_t>(std::count_if(active_.begin(), active_.begin() + in_map, is_active));
  std::erase_if(active_, [&](std::size_t node) { return !is_active(node); });
  if (active_.empty()) {
    Request request;
    request.kind = Request::Kind::add_node;
    active_.push_back(nodes_.size());
    request.connection = add_node(0);
    requests_.insert(requests_.begin(), request);
  }
  retire(std::max<std::size_t>(left, 1));
  connect_peers();
}

// Nodes that are no longer in the map have handed everything over.
void TestHarness::retire(std::size_t left) {
  while (active_.size() > left) {
    nodes_[active_.back()].role = nullptr;
    active_.pop_back();
  }
}

void TestHarness::connect(UserNumber number) {
  User& user = users_[number];
  user.in = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::server(),
                                            Endpoint::user(number));
  user.out = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::user(number),
                                             Endpoint::server());
  user.publication = std::make_unique<link::Publication>(config_.grid.cells(), 16);
  UserSetup setup;
  setup.user = number;
  setup.model = config_.model;
  setup.publications = &publications_;
  setup.interest = config_.interest;
  setup.server = {&user.out->sender(), &user.in->receiver()};
  user.role = std::make_unique<UserRole>(setup);
  if (publications_.users.size() <= number) {
    publications_.users.resize(number + 1);
  }
  publications_.users[number] = {};
  publications_.users[number].publication = user.publication.get();
  Request request;
  request.kind = Request::Kind::connect;
  request.user = number;
  request.connection = {&user.in->sender(), &user.out->receiver()};
  requests_.push_back(request);
}

void TestHarness::disconnect(UserNumber number) {
  Request request;
  request.kind = Request::Kind::disconnect;
  request.user = number;
  requests_.push_back(request);
  leaving_.insert(number);
}

ObjectId TestHarness::spawn(ObjectSpec spec) {
  spec.number = spec.number != 0 ? spec.number : ++number_;
  Request request;
  request.kind = Request::Kind::spawn;
  request.object = ObjectId::of(spec.number, ++generation_);
  request.spec = spec;
  requests_.push_back(request);
  return request.object;
}

void TestHarness::destroy(ObjectId id) {
  Request request;
  request.kind = Request::Kind::destroy;
  request.object = id;
  requests_.push_back(request);
}

void TestHarness::place(ObjectId id, const Pose& pose) {
  Request request;
  request.kind = Request::Kind::place;
  request.object = id;
  request.spec.pose = pose;
  requests_.push_back(request);
}

void TestHarness::frame(const std::optional<RandomOrder>& random_order) {
  log_.clear();
  grow();
  order_.requests.swap(requests_);
  requests_.clear();
  frame_began_ = std::chrono::steady_clock::now();
  const std::uint64_t wanted = order_.ordered.load() + 1;
  order_.ordered.store(wanted);
  int quiet = 0;
  if (random_order) {
    step_in_random_order(*random_order);
  }
  while (order_.completed.load() != wanted) {
    quiet = step_in_order() ? 0 : quiet + 1;
    if (quiet == 3) {
      report_stopped_nodes();
      quiet = 0;
    }
  }
  for (NodeNumber number = 0; number < active_.size(); ++number) {
    Node& node = nodes_[active_[number]];
    if (server_->is_broken(number) && node.role != nullptr) {
      node.stopped_role = std::move(node.role);
    }
  }
  for (const NodeId lost : report().lost) {
    Node& node = nodes_[active_[lost.number()]];
    if (node.role != nullptr && server_->has_abandoned_nodes()) {
      node.stopped_role = std::move(node.role);  // lost because another node stopped inside a gate
    }
    node.stops_inside = nullptr;
  }
  if (!report().lost.empty() || server_->map().nodes() < active_.size()) {
    retire_lost();
  }
  for (const UserNumber number : leaving_) {
    publications_.users[number] = {};
    users_.erase(number);
  }
  leaving_.clear();
}

// Adds the fallback node for the last node.
void TestHarness::fallback() {
  if (order_.fallback_wanted.exchange(false)) {
    active_[order_.fallback_for] = nodes_.size();
    order_.fallback = add_node(order_.fallback_for);
    nodes_.back().role->assign(order_.fallback_for, std::vector<Connection>(active_.size()));
    order_.fallback_ready.store(true);
  }
}

bool TestHarness::step_in_order() {
  if (between) {
    between();
  }
  bool progressed = server_->step() == Step::progressed;
  fallback();
  for (const std::size_t number : active_) {
    Node& node = nodes_[number];
    if (node.stops_inside != nullptr && node.role != nullptr && node.stops_inside->enter()) {
      node.messages = 0;
    }
  }
  for (const std::size_t node : active_) {
    CdNodeRole* role = nodes_[node].role.get();
    progressed |= role != nullptr && nodes_[node].messages != 0 && role->step() == Step::progressed;
  }
  for (auto& [number, user] : users_) {
    progressed |= user.role->step() == Step::progressed;
  }
  for (const std::size_t node : active_) {
    progressed |= pass(nodes_[node]);
  }
  for (auto& [ends, channel] : peers_) {
    progressed |= is_stepped(ends.second) && channel->pass({}, log_);
  }
  for (auto& [number, user] : users_) {
    progressed |= user.out->pass(tamper, log_);
    progressed |= user.in->pass({}, log_);
  }
  return progressed;
}

// Until the frame is complete, or all losses have happened and enough random rounds have passed; the rest runs in
// order.
void TestHarness::step_in_random_order(const RandomOrder& random_order) {
  std::mt19937_64& random = *random_order.random;
  const auto one_in = [&](std::uint64_t n) { return random() % n == 0; };
  for (Node& node : nodes_) {
    node.period = std::array{1u, 1u, 2u, 8u, 30u}[random() % 5];
    node.still_runs &= !one_in(3);
  }
  const std::uint64_t server_period = 1 + random() % 4;
  const std::uint64_t until_loss = 1 + random() % 60;
  const std::array<unsigned, 6> channel_periods{1, 1, 1, 3, 10, one_in(3) ? 60u : 1u};
  const auto draw_period = [&](const std::unique_ptr<TappedChannel>& channel) {
    if (channel != nullptr) channel->period = channel_periods[random() % channel_periods.size()];
  };
  for (Node& node : nodes_) {
    draw_period(node.in);
    draw_period(node.out);
  }
  for (auto& [ends, channel] : peers_) {
    draw_period(channel);
  }
  std::size_t losses = random_order.losses;
  bool may_lose = !random_order.late;
  std::size_t log_position = 0;  // position in the log
  // The fallback node is not lost in the same frame: it runs on the server's thread.
  const std::size_t known = nodes_.size();
  for (int round = 0; round < 400 && order_.completed.load() != order_.ordered.load(); ++round) {
    if (one_in(server_period)) {
      server_->step();
    }
    fallback();
    for (Node& node : nodes_) {
      CdNodeRole* const role = node.role != nullptr ? node.role.get()
                               : node.still_runs    ? node.stopped_role.get()
                                                    : nullptr;
      if (role != nullptr && node.period != 0 && one_in(node.period)) {
        role->step();
      }
    }
    for (auto& [number, user] : users_) {
      if (one_in(2)) user.role->step();
    }
    const auto pass = [&](const std::unique_ptr<TappedChannel>& channel) {
      if (channel != nullptr && one_in(channel->period)) channel->pass({}, log_, 1 + random() % 4);
    };
    for (std::size_t node = 0; node < nodes_.size(); ++node) {
      if (is_stepped(node)) pass(nodes_[node].in);
      pass(nodes_[node].out);
    }
    for (auto& [ends, channel] : peers_) {
      if (is_stepped(ends.second)) pass(channel);
    }
    for (auto& [number, user] : users_) {
      pass(user.out);
      pass(user.in);
    }
    const auto number = static_cast<NodeNumber>(random() % active_.size());
    const bool is_active = active_[number] < known && nodes_[active_[number]].role != nullptr;
    for (; !may_lose && log_position < log_.size(); ++log_position) {
      may_lose = log_[log_position].type() == MessageType::frame_end;
    }
    if (losses > 0 && may_lose && is_active && one_in(until_loss)) {
      losses -= lose(number, !one_in(3)) ? 1 : 0;
    }
  }
}

std::vector<Endpoint> TestHarness::hosts_of(ObjectNumber number) const {
  std::vector<Endpoint> hosts;
  for (NodeNumber node = 0; node < active_.size(); ++node) {
    if (nodes_[active_[node]].role->host().find(number) != base::NumberIndex::none) {
      hosts.push_back(Endpoint::node(node));
    }
  }
  for (const auto& [user, own] : users_) {
    if (own.role->host().find(number) != base::NumberIndex::none) {
      hosts.push_back(Endpoint::user(user));
    }
  }
  const std::uint32_t slot = table().find(number);
  if (hosts.empty() && slot != base::NumberIndex::none && table().host(slot).is_server()) {
    hosts.push_back(Endpoint::server());
  }
  return hosts;
}

void TestHarness::require_one_host_each() const {
  std::size_t hosted = 0;
  for (std::uint32_t slot = 0; slot < table().slots(); ++slot) {
    const ObjectRow& row = table().row(slot);
    if (!table().alive(slot)) {
      continue;
    }
    const Pose& pose = server_->pose(slot);
    const auto hosts = hosts_of(row.object.number);
    CAPTURE(row.object.number);
    const Endpoint host = table().host(slot);
    CAPTURE(host.value);
    if (row.category == static_cast<std::uint16_t>(Category::fixed)) {
      REQUIRE(hosts.empty());
      continue;
    }
    REQUIRE(hosts.size() == 1);
    REQUIRE(hosts[0] == host);
    hosted += host.is_server() ? 0 : 1;
    if (config_.deployment == Deployment::user_collision &&
        row.category != static_cast<std::uint16_t>(Category::avatar)) {
      std::uint32_t point[3];
      space_.point(pose.position, point);
      REQUIRE(host == Endpoint::node(server_->map().owner_at(point)));
    }
  }
  std::size_t held = 0;
  for (const std::size_t node : active_) {
    held += nodes_[node].role->host().size();
  }
  for (const auto& [user, own] : users_) {
    held += own.role->host().size();
  }
  REQUIRE(held == hosted);  // no role hosts an object that is gone
}

void TestHarness::require_views() const {
  const auto category = [](const ObjectRow& row) { return static_cast<Category>(row.category); };
  const auto present = [&](std::uint32_t slot) { return table().alive(slot) && table().present()[slot] != 0; };
  const auto at = [&](std::uint32_t slot) {
    std::uint32_t point[3];
    space_.point(server_->pose(slot).position, point);
    return config_.grid.box_of(config_.grid.cell_of(point));
  };
  const double r = config_.interest;
  for (const auto& entry : users_) {
    const UserNumber user = entry.first;
    const User& own = entry.second;
    CAPTURE(user);
    std::vector<regions::CellBox> near;
    for (std::uint32_t slot = 0; slot < table().slots(); ++slot) {
      const ObjectRow& row = table().row(slot);
      if (r > 0 && present(slot) && category(row) == Category::avatar && table().origin(slot).user == user) {
        const Vec3d p = row.pose.position;
        geometry::Bounds bounds;
        space_.point({p.x - r, p.y - r, p.z - r}, bounds.lower);
        space_.point({p.x + r, p.y + r, p.z + r}, bounds.upper);
        near.push_back(config_.grid.cells_of(bounds));
      }
    }
    std::map<ObjectNumber, Pose> seen;
    for (const auto run : own.role->seen(last())) {
      for (const link::PublishedState& state : run) {
        CAPTURE(state.number);
        REQUIRE(seen.emplace(state.number, state.pose).second);
      }
    }
    std::size_t expected = 0;
    for (std::uint32_t slot = 0; slot < table().slots(); ++slot) {
      const ObjectRow& row = table().row(slot);
      if (!present(slot) || category(row) == Category::fixed || table().host(slot) == Endpoint::user(user) ||
          std::none_of(near.begin(), near.end(), [&](const regions::CellBox& box) { return box.contains(at(slot)); })) {
        continue;
      }
      CAPTURE(row.object.number);
      const auto state = seen.find(row.object.number);
      REQUIRE(state != seen.end());
      REQUIRE(state->second == server_->pose(slot));
      ++expected;
    }
    REQUIRE(seen.size() == expected);
  }
}

}  // namespace ringfence::nodes::test
