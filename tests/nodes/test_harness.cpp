#include "nodes/test_harness.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <tuple>
#include <utility>

#include <doctest/doctest.h>

#include "nodes/logged_words.hpp"

namespace ringfence::nodes::test {

TestHarness::TestHarness(const HarnessConfig& config)
    : config_(config), map_(config.grid, config.nodes), relay_(16, config.interest) {
  publications_.server.publication = &relay_;
  ServerSetup setup;
  setup.shapes = &shapes_;
  setup.space = &space_;
  setup.model = config.model;
  setup.publications = &publications_;
  setup.order = &order_;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.exchange = exchange_kind();
  setup.frame_control = config.shares_memory ? &frame_control_ : nullptr;
  setup.layer_masks.fill(~0u);
  setup.capacities = {16, 16, 16, 4};
  setup.interest = config.interest;
  setup.max_relayed_nodes = 0;
  setup.balance_by = BalanceBy::pairs;  // every run has the same maps
  setup.quotas = config.quotas;
  setup.deepest_contacts = config.deepest_contacts;
  setup.user_deadline_ns = config.user_deadline_ns;
  setup.node_deadline_ns = config.node_deadline_ns;
  setup.nodes_may_be_lost = config.nodes_may_be_lost;
  pool_.emplace(pool_setup());
  for (std::uint32_t node = 0; node < config.nodes; ++node) {
    setup.nodes.push_back(pool_->add(map_, config.nodes, false).server.first);
  }
  pool_->connect();
  server_.emplace(setup, map_);
}

struct TestHarness::ServerChannel {
  TappedChannel to_node, from_node;
  NodeContacts node_contacts;
  std::optional<HostPublication> publication;
};

facade::NodePoolSetup TestHarness::pool_setup() {
  facade::NodePoolSetup setup;
  setup.role.shapes = &shapes_;
  setup.role.space = &space_;
  setup.role.model = config_.model;
  setup.role.placement = config_.placement;
  setup.role.exchange = exchange_kind();
  setup.role.frame_control = config_.shares_memory ? &frame_control_ : nullptr;
  setup.role.hosts = config_.deployment == Deployment::user_collision;
  setup.role.layer_masks.fill(~0u);
  setup.role.may_be_lost = config_.nodes_may_be_lost;
  setup.connect_to_server = [this](const facade::PoolNode& node, std::size_t) { return connect_to_server(node); };
  setup.connect = [this](const facade::PoolNode& first, const facade::PoolNode& second, std::size_t) {
    return connect_nodes(first, second);
  };
  return setup;
}

facade::PoolChannel TestHarness::connect_to_server(const facade::PoolNode& node) {
  controls_.resize(node.id + 1);
  const Endpoint self = Endpoint::node(node.slot);
  const std::size_t ring = config_.ring_bytes, delivery = config_.delivery_bytes;
  auto channel = std::shared_ptr<ServerChannel>(new ServerChannel{
      {ring, delivery, Endpoint::server(), self}, {ring, delivery, self, Endpoint::server()}, {}, {}});
  NodeContacts* const node_contacts = config_.shares_memory ? &channel->node_contacts : nullptr;
  if (config_.shares_memory && config_.deployment == Deployment::user_collision && config_.interest > 0) {
    channel->publication.emplace(16, config_.interest);
  }
  HostPublication* const publication = channel->publication ? &*channel->publication : nullptr;
  return {{&channel->to_node.sender(), &channel->from_node.receiver(), node_contacts, publication},
          {&channel->from_node.sender(), &channel->to_node.receiver(), node_contacts, publication},
          channel};
}

facade::PoolChannel TestHarness::connect_nodes(const facade::PoolNode& first, const facade::PoolNode& second) {
  const auto tap = [&](const facade::PoolNode& from, const facade::PoolNode& to) {
    return peers_[{from.id, to.id}] = std::make_shared<TappedChannel>(
               config_.ring_bytes, config_.delivery_bytes, Endpoint::node(from.slot), Endpoint::node(to.slot));
  };
  const auto forward = tap(first, second), backward = tap(second, first);
  return {{&forward->sender(), &backward->receiver()}, {&backward->sender(), &forward->receiver()}, {}};
}

TestHarness::ServerChannel& TestHarness::channel_of(const facade::PoolNode& node) {
  return *static_cast<ServerChannel*>(node.server.owner.get());
}

facade::PoolNode& TestHarness::node_at(std::size_t node) const {
  facade::PoolNode* found = nullptr;
  pool_->each([&](facade::PoolNode& each) { found = node-- == 0 ? &each : found; });
  REQUIRE(found != nullptr);
  return *found;
}

// Also those that are gone: the pool keeps them because free_retired() is never called.
std::vector<facade::PoolNode*> TestHarness::all_nodes() const {
  std::vector<facade::PoolNode*> all;
  for (const auto& node : pool_->retired()) {
    all.push_back(node.get());
  }
  pool_->each([&](facade::PoolNode& node) { all.push_back(&node); });
  return all;
}

void TestHarness::kill(std::size_t node, std::size_t messages) { control(node_at(node)).messages = messages; }

void TestHarness::stop_inside(std::size_t node, GateOf gate) {
  const facade::PoolNode& stopping = node_at(node);
  NodeContacts& node_contacts = channel_of(stopping).node_contacts;
  control(stopping).stops_inside =
      gate == GateOf::ghost_updates ? &node_contacts.ghost_updates.gate : &node_contacts.gate;
}

// Passes messages between a node and the server until the node stops.
bool TestHarness::pass(const facade::PoolNode& node) {
  const std::size_t before = log_.size();
  const bool from_node = channel_of(node).from_node.pass(tamper_nodes, log_);
  const bool delivered = channel_of(node).to_node.pass({}, log_);
  count_messages(node, log_.size() - before);
  return from_node || delivered;
}

void TestHarness::count_messages(const facade::PoolNode& node, std::size_t messages) {
  std::size_t& left = control(node).messages;
  if (left != ~std::size_t{0}) {
    left -= std::min(left, messages);
  }
}

// Words of FrameControl and StepReport are not delayed, so neither are messages of roles that share memory.
bool TestHarness::step_node(const facade::PoolNode& node) {
  if (config_.shares_memory) {
    pass(node);
  }
  const bool progressed = node.role->step() == Step::progressed;
  if (config_.shares_memory) {
    const ServerChannel& channel = channel_of(node);
    const StepReport& report = channel.node_contacts.report;
    const std::size_t before = log_.size();
    channel_of(node).from_node.pass(tamper_nodes, log_);  // messages before words
    log_reports(log_, Endpoint::node(node.slot), frames(), report, control(node).reached,
                channel.publication && channel.publication->wanted);
    control(node).reached = report.reached.load();
    count_messages(node, log_.size() - before);
  }
  return progressed;
}

bool TestHarness::step_server() {
  if (config_.shares_memory) {
    for (const facade::PoolNode* node : all_nodes()) {
      channel_of(*node).from_node.pass(tamper_nodes, log_);
    }
  }
  const FrameControl::Announced before = frame_control_.announced();
  const std::uint64_t frame = frames();
  const bool progressed = server_->step() == Step::progressed;
  const FrameControl::Announced announced = frame_control_.announced();
  // One step announces at most the end of the frame before it waits for the nodes.
  if (announced != before && announced.is_of(frame)) {
    pool_->each([&](const facade::PoolNode& node) {
      if (!control(node).stopped) {
        channel_of(node).to_node.pass({}, log_);  // those that were sent before
        log_.push_back(logged_word(Endpoint::server(), Endpoint::node(node.slot), type_of(announced.step()), frame));
        count_messages(node, 1);
      }
    });
  }
  return progressed;
}

bool TestHarness::lose(const facade::PoolNode& node, bool still_runs) {
  if (!server_->lose(node.slot)) {
    return false;  // it has not begun the frame
  }
  control(node).stopped = true;
  control(node).still_runs = still_runs;
  return true;
}

// Nothing progresses because of the stopped nodes; reports the first of them as lost.
void TestHarness::report_stopped_nodes() {
  const facade::PoolNode* stopped = nullptr;
  pool_->each([&](const facade::PoolNode& node) {
    stopped = stopped == nullptr && !control(node).stopped && control(node).messages == 0 ? &node : stopped;
  });
  if (stopped != nullptr) {
    lose(*stopped, false);
    return;
  }
  // Only a node that has stopped inside a gate may make the frame wait, until its deadline.
  REQUIRE(std::any_of(controls_.begin(), controls_.end(),
                      [](const Control& control) { return control.stops_inside != nullptr; }));
  REQUIRE(std::chrono::steady_clock::now() - frame_began_ < std::chrono::seconds(20));
}

void TestHarness::request_join(facade::PoolNode& node, base::SystemVector<Request>::iterator where) {
  Request request;
  request.kind = Request::Kind::add_node;
  request.node = node.slot;
  request.node_id = node.id;
  request.connection = node.server.first;
  requests_.insert(where, request);
}

// As World does when a frame begins.
void TestHarness::resize_nodes() {
  if (resize_to_ == 0) {
    return;
  }
  Request request;
  request.kind = Request::Kind::retire_node;
  for (const NodeNumber slot : pool_->youngest(pool_->size() - std::min<std::size_t>(pool_->size(), resize_to_))) {
    request.node = slot;
    requests_.push_back(request);
  }
  while (pool_->size() < resize_to_) {
    request_join(pool_->add(server_->map(), resize_to_, false), requests_.end());
  }
  pool_->connect();
  request.kind = Request::Kind::partition;
  requests_.push_back(request);
  resize_to_ = 0;
}

// As World does when a frame is complete.
void TestHarness::remove_gone_nodes() {
  const std::vector<NodeId>& lost = report().lost;
  std::vector<NodeNumber> gone;
  pool_->each([&](const facade::PoolNode& node) {
    if (std::count(lost.begin(), lost.end(), NodeId(node.id)) != 0 || server_->has_left(node.slot)) {
      control(node).stopped = true;
      control(node).stops_inside = nullptr;
      gone.push_back(node.slot);
    }
  });
  if (gone.empty() && lost.empty()) {
    return;
  }
  pool_->remove(gone);
  if (pool_->size() == 0) {
    request_join(pool_->add(server_->map(), 1, false), requests_.begin());
  }
  pool_->connect();
}

void TestHarness::connect(UserNumber number) {
  User& user = users_[number];
  user.in = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::server(),
                                            Endpoint::user(number));
  user.out = std::make_unique<TappedChannel>(config_.ring_bytes, config_.delivery_bytes, Endpoint::user(number),
                                             Endpoint::server());
  user.publication = std::make_unique<HostPublication>(16, config_.interest);
  user.reader = std::make_unique<InterestReader>(publications_, config_.interest);
  UserSetup setup;
  setup.user = number;
  setup.model = config_.model;
  user.role = std::make_unique<UserRole>(setup);
  UserThreadSetup thread;
  thread.server = {&user.out->sender(), &user.in->receiver(), nullptr, user.publication.get()};
  thread.publications = &publications_;
  thread.parts.reader = user.reader.get();
  user.thread = std::make_unique<UserThreadRole>(thread, std::vector<UserRole*>{user.role.get()});
  Request request;
  request.kind = Request::Kind::connect;
  request.user = number;
  request.connection = {&user.in->sender(), &user.out->receiver(), nullptr, user.publication.get()};
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
  resize_nodes();
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
  merge_answers();
  remove_gone_nodes();
  for (const UserNumber number : leaving_) {
    users_.erase(number);
  }
  leaving_.clear();
}

void TestHarness::ask(std::vector<messages::QueryRecord> queries) {
  queries_.push_back(std::move(queries));
  order_.queries = queries_.back();
}

void TestHarness::merge_answers() {
  std::vector<const NodeQueries*> nodes;
  answers_.reset();
  if (order_.queries.empty() || !server_->list_answers(nodes)) {
    return;
  }
  std::vector<FoundHit> all;
  for (const NodeQueries* node : nodes) {
    for (const messages::QueryHitRecord& hit : node->hits) {
      const bool any = order_.queries[hit.query].kind == static_cast<std::uint32_t>(messages::QueryKind::cast_any);
      const ObjectNumber number = any ? 0 : table().row(hit.slot).object.number;
      all.push_back({hit.query, hit.place, number, hit.triangle, hit.point, hit.normal});
    }
  }
  std::sort(all.begin(), all.end(), [](const FoundHit& p, const FoundHit& q) {
    return std::tuple(p.query, p.place, p.number) < std::tuple(q.query, q.place, q.number);
  });
  answers_.emplace();
  for (const FoundHit& hit : all) {
    const bool first = answers_->empty() || answers_->back().query != hit.query;
    if (first || messages::has_list(order_.queries[hit.query])) {
      answers_->push_back(hit);
    }
  }
}

// Puts a fallback node in the place of the last node.
void TestHarness::fallback() {
  if (order_.fallback_wanted.exchange(false)) {
    const facade::PoolNode& node = pool_->replace(order_.fallback_slot, server_->map());
    order_.fallback_id = node.id;
    order_.fallback = node.server.first;
    order_.fallback_ready.store(true);
  }
}

bool TestHarness::step_in_order() {
  if (between) {
    between();
  }
  bool progressed = step_server();
  fallback();
  pool_->each([&](const facade::PoolNode& node) {
    Control& own = control(node);
    if (own.stops_inside != nullptr && !own.stopped && own.stops_inside->enter()) {
      own.messages = 0;
    }
  });
  pool_->each([&](const facade::PoolNode& node) {
    const Control& own = control(node);
    progressed |= !own.stopped && own.messages != 0 && step_node(node);
  });
  for (auto& [number, user] : users_) {
    progressed |= user.thread->step() == Step::progressed;
  }
  pool_->each([&](const facade::PoolNode& node) { progressed |= pass(node); });
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
  for (Control& node : controls_) {
    node.period = std::array{1u, 1u, 2u, 8u, 30u}[random() % 5];
    node.still_runs &= !one_in(3);
  }
  const std::uint64_t server_period = 1 + random() % 4;
  const std::uint64_t until_loss = 1 + random() % 60;
  const std::array<unsigned, 6> channel_periods{1, 1, 1, 3, 10, one_in(3) ? 60u : 1u};
  const auto draw_period = [&](TappedChannel& channel) {
    channel.period = channel_periods[random() % channel_periods.size()];
  };
  for (const facade::PoolNode* node : all_nodes()) {
    draw_period(channel_of(*node).to_node);
    draw_period(channel_of(*node).from_node);
  }
  for (auto& [ends, channel] : peers_) {
    draw_period(*channel);
  }
  std::size_t losses = random_order.losses;
  bool may_lose = !random_order.late;
  std::size_t log_position = 0;  // position in the log
  // The fallback node is not lost in the same frame: it runs on the server's thread.
  const std::size_t known = controls_.size();
  for (int round = 0; round < 400 && order_.completed.load() != order_.ordered.load(); ++round) {
    if (one_in(server_period)) {
      step_server();
    }
    fallback();
    const std::vector<facade::PoolNode*> all = all_nodes();
    for (const facade::PoolNode* node : all) {
      const unsigned period = control(*node).period;
      if (is_stepped(node->id) && period != 0 && one_in(period)) {
        step_node(*node);
      }
    }
    for (auto& [number, user] : users_) {
      if (one_in(2)) user.thread->step();
    }
    const auto pass = [&](TappedChannel& channel) {
      if (one_in(channel.period)) channel.pass({}, log_, 1 + random() % 4);
    };
    for (const facade::PoolNode* node : all) {
      if (config_.shares_memory) break;  // see step_node()
      if (is_stepped(node->id)) pass(channel_of(*node).to_node);
      pass(channel_of(*node).from_node);
    }
    for (auto& [ends, channel] : peers_) {
      if (is_stepped(ends.second)) pass(*channel);
    }
    for (auto& [number, user] : users_) {
      pass(*user.out);
      pass(*user.in);
    }
    const facade::PoolNode& node = node_at(random() % pool_->size());
    const bool may_be_lost = node.id < known && !control(node).stopped;
    may_lose |=
        frame_control_.announced().is_of(frames()) && frame_control_.announced().step() == AnnouncedStep::frame_end;
    for (; !may_lose && log_position < log_.size(); ++log_position) {
      may_lose = log_[log_position].type() == MessageType::frame_end;
    }
    if (losses > 0 && may_lose && may_be_lost && one_in(until_loss)) {
      losses -= lose(node, !one_in(3)) ? 1 : 0;
    }
  }
}

std::vector<Endpoint> TestHarness::hosts_of(ObjectNumber number) const {
  std::vector<Endpoint> hosts;
  pool_->each([&](const facade::PoolNode& node) {
    if (node.role->host().find(number) != base::NumberIndex::none) {
      hosts.push_back(Endpoint::node(node.slot));
    }
  });
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
  pool_->each([&](const facade::PoolNode& node) { held += node.role->host().size(); });
  for (const auto& [user, own] : users_) {
    held += own.role->host().size();
  }
  REQUIRE(held == hosted);  // no role hosts an object that is gone
}

void TestHarness::require_views() const {
  const auto category = [](const ObjectRow& row) { return static_cast<Category>(row.category); };
  const auto present = [&](std::uint32_t slot) { return table().alive(slot) && table().present()[slot] != 0; };
  const double r = config_.interest;
  for (const auto& entry : users_) {
    const UserNumber user = entry.first;
    const User& own = entry.second;
    CAPTURE(user);
    std::vector<Vec3d> avatars;
    for (std::uint32_t slot = 0; slot < table().slots(); ++slot) {
      const ObjectRow& row = table().row(slot);
      if (r > 0 && present(slot) && category(row) == Category::avatar && table().origin(slot).user == user) {
        avatars.push_back(row.pose.position);
      }
    }
    std::map<ObjectNumber, Pose> seen;
    for (const auto run : own.role->seen(last())) {
      for (const PublishedState& state : run) {
        CAPTURE(state.number);
        REQUIRE(seen.emplace(state.number, state.pose).second);
      }
    }
    std::size_t others = 0;
    for (std::uint32_t slot = 0; slot < table().slots(); ++slot) {
      const ObjectRow& row = table().row(slot);
      if (!present(slot) || category(row) == Category::fixed || table().host(slot) == Endpoint::user(user)) continue;
      CAPTURE(row.object.number);
      const Vec3d at = server_->pose(slot).position;
      const auto is_near = [&](const Vec3d& p) {
        return std::abs(p.x - at.x) <= r && std::abs(p.y - at.y) <= r && std::abs(p.z - at.z) <= r;
      };
      const auto state = seen.find(row.object.number);
      if (state == seen.end()) {
        REQUIRE(std::none_of(avatars.begin(), avatars.end(), is_near));
        continue;
      }
      REQUIRE(state->second == server_->pose(slot));
      ++others;
    }
    REQUIRE(seen.size() == others);  // nothing of its own, and nothing that is gone
    REQUIRE((seen.empty() || !avatars.empty()));
  }
}

}  // namespace ringfence::nodes::test
