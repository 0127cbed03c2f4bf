#include "nodes/theatre.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <doctest/doctest.h>

namespace ringfence::nodes::test {

bool Wire::pass(const Tamper& tamper, std::vector<Seen>& log, std::size_t most) {
  bool any = false;
  for (std::size_t passed = 0; passed < most; ++passed) {
    const auto bytes = near_.receiver().next();
    if (bytes.empty()) {
      break;
    }
    any = true;
    Seen seen{from_, to_, {}, {bytes.begin(), bytes.end()}};
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

void Wire::forge(std::span<const std::byte> message) {
  const auto room = far_.sender().claim(message.size());
  REQUIRE(room.size() == message.size());
  std::copy(message.begin(), message.end(), room.begin());
  far_.sender().commit(message.size());
  far_.sender().publish();
}

Theatre::Theatre(const Stageplay& play) : play_(play), map_(play.grid, play.nodes), relay_(play.grid.cells(), 16) {
  publications_.grid = play.grid;
  publications_.space = &space_;
  publications_.server.publication = &relay_;
  ServerSetup setup;
  setup.shapes = &shapes_;
  setup.space = &space_;
  setup.model = play.model;
  setup.publications = &publications_;
  setup.order = &order_;
  setup.deployment = play.deployment;
  setup.placement = play.placement;
  setup.layer_masks.fill(~0u);
  setup.capacities = {16, 16, 16, 4};
  setup.interest = play.interest;
  setup.relays_for = 0;
  setup.quotas = play.quotas;
  setup.user_deadline_ns = play.user_deadline_ns;
  for (NodeNumber node = 0; node < play.nodes; ++node) {
    standing_.push_back(node);
    setup.nodes.push_back(add_node(node));
  }
  introduce();
  server_.emplace(setup, map_);
}

Line Theatre::add_node(NodeNumber number) {
  Node& node = nodes_.emplace_back();
  node.in = std::make_unique<Wire>(play_.ring_bytes, play_.delivery_bytes, Endpoint::server(), Endpoint::node(number));
  node.out = std::make_unique<Wire>(play_.ring_bytes, play_.delivery_bytes, Endpoint::node(number), Endpoint::server());
  CdNodeSetup own;
  own.node = number;
  own.shapes = &shapes_;
  own.space = &space_;
  own.model = play_.model;
  own.placement = play_.placement;
  own.layer_masks.fill(~0u);
  if (play_.shares_memory) {
    node.findings = std::make_unique<Findings>();
    if (play_.deployment == Deployment::user_collision && play_.interest > 0) {
      if (play_.all_publish || number % 2 == 0) {
        node.publication = std::make_unique<NodePublication>(play_.grid, 16);
      } else {
        own.keeps_states = false;
      }
    }
  }
  own.interest_grid = play_.grid;
  own.server = {&node.out->sender(), &node.in->receiver(), node.findings.get(), node.publication.get()};
  own.peers.resize(std::max<std::size_t>(play_.nodes, number + 1));
  node.role = std::make_unique<CdNodeRole>(own, server_ ? server_->map() : map_);
  return {&node.in->sender(), &node.out->receiver(), node.findings.get(), node.publication.get()};
}

// Tells every node of the others, by the numbers that they have now.
void Theatre::introduce() {
  for (NodeNumber p = 0; p < standing_.size(); ++p) {
    std::vector<Line> peers(standing_.size());
    for (NodeNumber q = 0; q < standing_.size(); ++q) {
      if (p == q) {
        continue;
      }
      for (const auto& [from, to] : {std::pair(p, q), std::pair(q, p)}) {
        auto& wire = peers_[{standing_[from], standing_[to]}];
        if (wire == nullptr) {
          wire =
              std::make_unique<Wire>(play_.ring_bytes, play_.delivery_bytes, Endpoint::node(from), Endpoint::node(to));
        }
      }
      peers[q] = {&peers_[{standing_[p], standing_[q]}]->sender(), &peers_[{standing_[q], standing_[p]}]->receiver(),
                  nodes_[standing_[q]].findings.get()};
    }
    nodes_[standing_[p]].role->meet(p, peers);
  }
}

void Theatre::kill(NodeNumber node, std::size_t messages) { nodes_[standing_[node]].messages = messages; }

// Passes what a node and the server say to each other, for as long as it lives.
bool Theatre::pass(Node& node) {
  const std::size_t before = log_.size();
  const bool heard = node.out->pass({}, log_);
  const bool told = node.in->pass({}, log_);
  if (node.messages != ~std::size_t{0}) {
    node.messages -= std::min(node.messages, log_.size() - before);
  }
  return heard || told;
}

bool Theatre::lose(NodeNumber number, bool goes_on) {
  if (!server_->lose(number)) {
    return false;  // it has not begun the frame
  }
  Node& node = nodes_[standing_[number]];
  node.dead = std::move(node.role);
  node.goes_on = goes_on;
  return true;
}

// Nothing gets on. The dead are the reason; the link to the first of them closes.
void Theatre::lose_the_dead() {
  for (NodeNumber number = 0; number < standing_.size(); ++number) {
    Node& node = nodes_[standing_[number]];
    if (node.role != nullptr && node.messages == 0) {
      lose(number, false);
      return;
    }
  }
  REQUIRE(false);  // a frame that hangs
}

// As the World does when a frame begins.
void Theatre::grow() {
  if (resize_to_ == 0) {
    return;
  }
  Request request;
  request.kind = Request::Kind::add_node;
  while (standing_.size() < resize_to_) {
    const auto number = static_cast<NodeNumber>(standing_.size());
    standing_.push_back(nodes_.size());
    request.line = add_node(number);
    requests_.push_back(request);
  }
  introduce();
  request.kind = Request::Kind::resize;
  request.nodes = std::exchange(resize_to_, 0u);
  requests_.push_back(request);
}

// The frame is over: those that are left are numbered anew, in order, as the server does at its next cut.
void Theatre::bury() {
  const auto in_map = static_cast<std::ptrdiff_t>(std::min<std::size_t>(server_->map().nodes(), standing_.size()));
  const auto stands = [&](std::size_t node) { return nodes_[node].role != nullptr; };
  const auto left = static_cast<std::size_t>(std::count_if(standing_.begin(), standing_.begin() + in_map, stands));
  std::erase_if(standing_, [&](std::size_t node) { return !stands(node); });
  if (standing_.empty()) {
    Request request;
    request.kind = Request::Kind::add_node;
    standing_.push_back(nodes_.size());
    request.line = add_node(0);
    requests_.insert(requests_.begin(), request);
  }
  retire(std::max<std::size_t>(left, 1));
  introduce();
}

// Those that the map no longer knows have handed everything over.
void Theatre::retire(std::size_t left) {
  while (standing_.size() > left) {
    nodes_[standing_.back()].role = nullptr;
    standing_.pop_back();
  }
}

void Theatre::connect(UserNumber number) {
  User& user = users_[number];
  user.in = std::make_unique<Wire>(play_.ring_bytes, play_.delivery_bytes, Endpoint::server(), Endpoint::user(number));
  user.out = std::make_unique<Wire>(play_.ring_bytes, play_.delivery_bytes, Endpoint::user(number), Endpoint::server());
  user.publication = std::make_unique<link::Publication>(play_.grid.cells(), 16);
  UserSetup setup;
  setup.user = number;
  setup.model = play_.model;
  setup.publications = &publications_;
  setup.interest = play_.interest;
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
  request.line = {&user.in->sender(), &user.out->receiver()};
  requests_.push_back(request);
}

void Theatre::disconnect(UserNumber number) {
  Request request;
  request.kind = Request::Kind::disconnect;
  request.user = number;
  requests_.push_back(request);
  leaving_.insert(number);
}

ObjectId Theatre::spawn(ObjectSpec spec) {
  spec.number = spec.number != 0 ? spec.number : ++number_;
  Request request;
  request.kind = Request::Kind::spawn;
  request.object = ObjectId::of(spec.number, ++generation_);
  request.spec = spec;
  requests_.push_back(request);
  return request.object;
}

void Theatre::destroy(ObjectId id) {
  Request request;
  request.kind = Request::Kind::destroy;
  request.object = id;
  requests_.push_back(request);
}

void Theatre::place(ObjectId id, const Pose& pose) {
  Request request;
  request.kind = Request::Kind::place;
  request.object = id;
  request.spec.pose = pose;
  requests_.push_back(request);
}

void Theatre::frame(const std::optional<Disorder>& disorder) {
  log_.clear();
  grow();
  order_.requests.swap(requests_);
  requests_.clear();
  const std::uint64_t wanted = order_.ordered.load() + 1;
  order_.ordered.store(wanted);
  int quiet = 0;
  if (disorder) {
    step_in_disorder(*disorder);
  }
  while (order_.completed.load() != wanted) {
    quiet = step_in_order() ? 0 : quiet + 1;
    if (quiet == 3) {
      lose_the_dead();
      quiet = 0;
    }
  }
  if (!report().lost.empty() || server_->map().nodes() < standing_.size()) {
    bury();
  }
  for (const UserNumber number : leaving_) {
    publications_.users[number] = {};
    users_.erase(number);
  }
  leaving_.clear();
}

// Another takes the place of the last node.
void Theatre::stand_in() {
  if (order_.stand_in_wanted.exchange(false)) {
    standing_[order_.stand_in_for] = nodes_.size();
    order_.stand_in = add_node(order_.stand_in_for);
    nodes_.back().role->meet(order_.stand_in_for, std::vector<Line>(standing_.size()));
    order_.stand_in_ready.store(true);
  }
}

bool Theatre::step_in_order() {
  if (between) {
    between();
  }
  bool progressed = server_->step() == Step::progressed;
  stand_in();
  for (const std::size_t node : standing_) {
    CdNodeRole* role = nodes_[node].role.get();
    progressed |= role != nullptr && nodes_[node].messages != 0 && role->step() == Step::progressed;
  }
  for (auto& [number, user] : users_) {
    progressed |= user.role->step() == Step::progressed;
  }
  for (const std::size_t node : standing_) {
    progressed |= pass(nodes_[node]);
  }
  for (auto& [ends, wire] : peers_) {
    progressed |= takes(ends.second) && wire->pass({}, log_);
  }
  for (auto& [number, user] : users_) {
    progressed |= user.out->pass(tamper, log_);
    progressed |= user.in->pass({}, log_);
  }
  return progressed;
}

// Until the frame is over, or has had its losses and so many rounds that what is left may go in order.
void Theatre::step_in_disorder(const Disorder& disorder) {
  std::mt19937_64& random = *disorder.random;
  const auto one_in = [&](std::uint64_t n) { return random() % n == 0; };
  for (Node& node : nodes_) {
    node.pace = std::array{1u, 1u, 2u, 8u, 30u}[random() % 5];
    node.goes_on &= !one_in(3);
  }
  const std::uint64_t server_pace = 1 + random() % 4;
  const std::uint64_t until_loss = 1 + random() % 60;
  const std::array<unsigned, 6> wire_paces{1, 1, 1, 3, 10, one_in(3) ? 60u : 1u};
  const auto draw_pace = [&](const std::unique_ptr<Wire>& wire) {
    if (wire != nullptr) wire->pace = wire_paces[random() % wire_paces.size()];
  };
  for (Node& node : nodes_) {
    draw_pace(node.in);
    draw_pace(node.out);
  }
  for (auto& [ends, wire] : peers_) {
    draw_pace(wire);
  }
  std::size_t losses = disorder.losses;
  bool may_lose = !disorder.late;
  std::size_t looked_at = 0;                // of the log
  const std::size_t known = nodes_.size();  // what stands in is not lost in the same frame: it is the server's thread
  for (int round = 0; round < 400 && order_.completed.load() != order_.ordered.load(); ++round) {
    if (one_in(server_pace)) {
      server_->step();
    }
    stand_in();
    for (Node& node : nodes_) {
      CdNodeRole* const role = node.role != nullptr ? node.role.get() : node.goes_on ? node.dead.get() : nullptr;
      if (role != nullptr && node.pace != 0 && one_in(node.pace)) {
        role->step();
      }
    }
    for (auto& [number, user] : users_) {
      if (one_in(2)) user.role->step();
    }
    const auto pass = [&](const std::unique_ptr<Wire>& wire) {
      if (wire != nullptr && one_in(wire->pace)) wire->pass({}, log_, 1 + random() % 4);
    };
    for (std::size_t node = 0; node < nodes_.size(); ++node) {
      if (takes(node)) pass(nodes_[node].in);
      pass(nodes_[node].out);
    }
    for (auto& [ends, wire] : peers_) {
      if (takes(ends.second)) pass(wire);
    }
    for (auto& [number, user] : users_) {
      pass(user.out);
      pass(user.in);
    }
    const auto number = static_cast<NodeNumber>(random() % standing_.size());
    const bool stands = standing_[number] < known && nodes_[standing_[number]].role != nullptr;
    for (; !may_lose && looked_at < log_.size(); ++looked_at) {
      may_lose = log_[looked_at].type() == MessageType::frame_end;
    }
    if (losses > 0 && may_lose && stands && one_in(until_loss)) {
      losses -= lose(number, !one_in(3)) ? 1 : 0;
    }
  }
}

std::vector<Endpoint> Theatre::hosts_of(ObjectNumber number) const {
  std::vector<Endpoint> hosts;
  for (NodeNumber node = 0; node < standing_.size(); ++node) {
    if (nodes_[standing_[node]].role->host().find(number) != NumberIndex::none) {
      hosts.push_back(Endpoint::node(node));
    }
  }
  for (const auto& [user, own] : users_) {
    if (own.role->host().find(number) != NumberIndex::none) {
      hosts.push_back(Endpoint::user(user));
    }
  }
  const std::uint32_t slot = table().find(number);
  if (hosts.empty() && slot != NumberIndex::none && table().host(slot).is_server()) {
    hosts.push_back(Endpoint::server());
  }
  return hosts;
}

void Theatre::require_one_host_each() const {
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
    if (play_.deployment == Deployment::user_collision &&
        row.category != static_cast<std::uint16_t>(Category::avatar)) {
      std::uint32_t point[3];
      space_.point(pose.position, point);
      REQUIRE(host == Endpoint::node(server_->map().owner_at(point)));
    }
  }
  std::size_t held = 0;
  for (const std::size_t node : standing_) {
    held += nodes_[node].role->host().size();
  }
  for (const auto& [user, own] : users_) {
    held += own.role->host().size();
  }
  REQUIRE(held == hosted);  // nobody holds on to what is gone
}

void Theatre::require_views() const {
  const auto category = [](const ObjectRow& row) { return static_cast<Category>(row.category); };
  const auto present = [&](std::uint32_t slot) { return table().alive(slot) && table().present()[slot] != 0; };
  const auto at = [&](std::uint32_t slot) {
    std::uint32_t point[3];
    space_.point(server_->pose(slot).position, point);
    return play_.grid.box_of(play_.grid.cell_of(point));
  };
  const double r = play_.interest;
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
        near.push_back(play_.grid.cells_of(bounds));
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
          std::none_of(near.begin(), near.end(), [&](const regions::CellBox& box) { return box.holds(at(slot)); })) {
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
