#include "nodes/cd_node/node_fixture.hpp"

#include <cstring>

#include <doctest/doctest.h>

#include "nodes/cd_node/halo_exchange.hpp"

namespace ringfence::nodes::test {

void ShiftModel::move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    outputs[i].pose.position.x += step;
  }
}

NodeFixture::NodeFixture(const NodeFixtureConfig& config)
    : to_server_(config.ring_bytes, nullptr, nullptr),
      to_peer_(config.ring_bytes, nullptr, nullptr),
      publication_(16, 8) {
  shapes_.add(Sphere{0.5f});
  CdNodeSetup setup;
  setup.node = config.node;
  setup.shapes = &shapes_;
  setup.space = &space_;
  setup.model = &model_;
  setup.placement = config.placement;
  setup.exchange = config.shares_memory ? ExchangeKind::shared : ExchangeKind::messages;
  setup.frame_control = config.shares_memory ? &frame_control_ : nullptr;
  setup.layer_masks.fill(~0u);
  setup.objects = setup.pairs = 16;
  setup.may_be_lost = config.may_be_lost;
  setup.server.out = &to_server_.sender();
  if (config.shares_memory) {
    setup.server.node_contacts = &contacts_;
    setup.server.publication = &publication_;
    auto nodes = std::make_shared<SharedNodes>(2, &contacts_);
    (*nodes)[1 - config.node] = &peer_contacts_;
    setup.shared_nodes = nodes;
  } else {
    setup.peers.resize(2);
    setup.peers[1 - config.node].out = &to_peer_.sender();
  }
  state_ = std::make_unique<NodeState>(setup, regions::RegionMap(grid_, 2));
  exchange_ = NodeExchange::make(*state_);
  if (config.shares_memory) {
    state_->assign(config.node, setup.shared_nodes);
  } else {
    state_->assign(config.node, setup.peers);
  }
  exchange_->assign();
  state_->begin(1);
}

geometry::Bounds NodeFixture::bounds(const Vec3d& position) const {
  Pose pose;
  pose.position = position;
  return shapes_.bounds(0, pose, space_);
}

std::uint32_t NodeFixture::host(ObjectNumber number, const Vec3d& position) {
  messages::HandOverRecord record;
  record.object = {number, 1, number, messages::flag_present};
  record.pose.position = position;
  record.category = static_cast<std::uint16_t>(Category::active);
  state_->host.adopt(record, nullptr);
  return state_->host.find(number);
}

messages::PositionRecord NodeFixture::position(ObjectNumber number, const Vec3d& position, std::uint32_t flags) const {
  messages::PositionRecord record;
  record.object = {number, 1, number, flags};
  record.pose.position = position;
  record.bounds = bounds(position);
  return record;
}

void NodeFixture::know(ObjectNumber number, const Vec3d& position, std::uint32_t flags) {
  HaloExchange(*state_).receive_positions(
      message(MessageType::position_update, this->position(number, position, flags)));
}

messages::MessageView NodeFixture::message(MessageType type, std::size_t record_bytes, std::size_t count,
                                           std::span<const std::byte> records, bool last, Endpoint from) {
  std::vector<std::uint64_t>& words = messages_.emplace_back((sizeof(messages::Header) + records.size() + 7) / 8);
  auto* const bytes = reinterpret_cast<std::byte*>(words.data());
  const messages::RunHeader head{type, from, state_->self, state_->frame, state_->region.map().epoch()};
  messages::write_header(bytes, head, record_bytes, count, last, count);
  if (!records.empty()) {
    std::memcpy(bytes + sizeof(messages::Header), records.data(), records.size());
  }
  messages::MessageView view;
  REQUIRE(messages::decode({bytes, sizeof(messages::Header) + records.size()}, 0, view) == Status::ok);
  return view;
}

std::vector<LoggedMessage> NodeFixture::taken(link::Receiver& receiver) {
  std::vector<LoggedMessage> sent;
  for (auto bytes = receiver.next(); !bytes.empty(); bytes = receiver.next()) {
    LoggedMessage& message = sent.emplace_back();
    message.bytes.assign(bytes.begin(), bytes.end());
    std::memcpy(&message.header, bytes.data(), sizeof message.header);
  }
  receiver.release();
  return sent;
}

}  // namespace ringfence::nodes::test
