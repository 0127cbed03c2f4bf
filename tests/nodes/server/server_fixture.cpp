#include "nodes/server/server_fixture.hpp"

#include <algorithm>

#include <doctest/doctest.h>

namespace ringfence::nodes::test {

ServerFixture::ServerFixture(const FixtureConfig& config) : config_(config), relay_(16, config.interest) {
  shapes_.add(Sphere{0.5f});
  publications_.server.publication = &relay_;
  ServerSetup setup;
  setup.shapes = &shapes_;
  setup.space = &space_;
  setup.model = config.model;
  setup.publications = &publications_;
  setup.order = &order_;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.exchange = config.shares_memory ? ExchangeKind::shared : ExchangeKind::messages;
  setup.frame_control = config.shares_memory ? &frame_control_ : nullptr;
  setup.layer_masks.fill(~0u);
  setup.capacities = {16, 16, 16, 4};
  setup.interest = config.interest;
  setup.max_relayed_nodes = 0;
  setup.balance_by = BalanceBy::pairs;
  setup.quotas = config.quotas;
  setup.nodes_may_be_lost = config.nodes_may_be_lost;
  setup.node_deadline_ns = config.node_deadline_ns;
  setup.user_deadline_ns = config.user_deadline_ns;
  for (NodeNumber node = 0; node < config.nodes; ++node) {
    setup.nodes.push_back(connection(Endpoint::node(node)));
  }
  state_ = std::make_unique<ServerState>(setup, regions::RegionMap(grid_, config.nodes));
  exchange_ = ServerExchange::make(*state_);
  state_->frame = 1;
  state_->report().frame = 1;
  for (PeerSession& session : state_->nodes) {
    session.in_report = state_->report().nodes.size();
    state_->report().nodes.emplace_back().id = NodeId(session.id);
  }
  state_->ledger.begin(1);
  state_->list_shared_nodes();
}

Connection ServerFixture::connection(Endpoint peer) {
  const std::unique_ptr<Peer>& made = peers_[peer.value] = std::make_unique<Peer>();
  const bool shares = config_.shares_memory && peer.is_node();
  made->node_contacts.host = &made->host;
  made->node_contacts.host_states.reserve(16, 0);
  made->publication = std::make_unique<HostPublication>(16, config_.interest);
  return {&made->to_peer.sender(), &made->from_peer.receiver(), shares ? &made->node_contacts : nullptr,
          shares && config_.interest > 0 ? made->publication.get() : nullptr};
}

void ServerFixture::connect(UserNumber user) {
  Connection made = connection(Endpoint::user(user));
  made.publication = peers_.at(Endpoint::user(user).value)->publication.get();
  state_->connect(user, made);
  state_->user_connections.back().published = true;
}

std::uint32_t ServerFixture::add(const Vec3d& position, Endpoint host, Category category, UserNumber user) {
  ObjectSpec spec;
  spec.number = ++numbers_;
  spec.shape = ShapeId(0);
  spec.pose.position = position;
  spec.category = category;
  spec.user = UserId(user);
  ObjectTable& objects = state_->objects;
  const std::uint32_t slot = objects.add(ObjectId::of(spec.number, 1), spec);
  objects.bounds(slot) = shapes_.bounds(0, spec.pose, space_);
  objects.set_host(slot, host);
  if (host.is_node() && config_.shares_memory) {
    this->host(host.number()).adopt(objects.hand_over(slot), objects.state(slot));
  }
  return slot;
}

std::vector<SentMessage> ServerFixture::sent_to(Endpoint peer) {
  std::vector<SentMessage> sent;
  link::Receiver& receiver = peers_.at(peer.value)->to_peer.receiver();
  for (auto bytes = receiver.next(); !bytes.empty(); bytes = receiver.next()) {
    SentMessage& message = sent.emplace_back();
    message.bytes.assign(bytes.begin(), bytes.end());
    std::memcpy(&message.header, bytes.data(), sizeof message.header);
  }
  receiver.release();
  return sent;
}

void ServerFixture::fill(Endpoint peer) {
  link::Sender& sender = peers_.at(peer.value)->to_peer.sender();
  const messages::RunHeader head{MessageType::probe, Endpoint::server(), peer, state_->frame, state_->map.epoch()};
  for (auto room = sender.claim(sizeof(messages::Header)); !room.empty(); room = sender.claim(room.size())) {
    messages::write_header(room.data(), head, 0, 0, true, 0);
    sender.commit(room.size());
  }
  sender.publish();
}

void ServerFixture::send(Endpoint from, MessageType type, std::size_t record_bytes, std::size_t count,
                         std::span<const std::byte> records, bool for_all) {
  const messages::RunHeader head{type, for_all ? Endpoint::all_users() : from, Endpoint::server(), state_->frame,
                                 state_->map.epoch()};
  link::Sender& sender = peers_.at(from.value)->from_peer.sender();
  const std::span<std::byte> room = sender.claim(sizeof(messages::Header) + records.size());
  REQUIRE(!room.empty());
  messages::write_header(room.data(), head, record_bytes, count, true, count);
  std::copy(records.begin(), records.end(), room.begin() + sizeof(messages::Header));
  sender.commit(room.size());
  sender.publish();
  if (config_.shares_memory && from.is_node()) {
    frame_control_.note_messages(from.number());
  }
}

void ServerFixture::report(NodeNumber node, ReportedStep step) {
  node_contacts(node).report.reached.store({state_->frame, state_->map.epoch(), step});
  frame_control_.arrive(node, step);
}

}  // namespace ringfence::nodes::test
