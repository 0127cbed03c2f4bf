#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <span>
#include <vector>

#include "geometry/shape_table.hpp"
#include "link/channel.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {

/// Moves every object by `step` along x in each frame.
class ShiftModel : public MotionModel {
 public:
  double step = 1;  ///< m
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;
};

/// Configuration of a fixture. The world is a cube of 64 m with cells of 16 m; node 0 owns x < 32, node 1 the rest.
struct NodeFixtureConfig {
  NodeNumber node = 0;
  Placement placement = Placement::region;
  bool shares_memory = true;  ///< server and both nodes share contacts and publications
  std::size_t ring_bytes = std::size_t{1} << 16;
  bool may_be_lost = true;
};

/// The data of one of two CD nodes in frame 1 whose server and peer are the test. There is no role, so a test calls one
/// part of the node alone. Objects are balls with a diameter of 1 m; the slot of an object is its number. The node
/// hosts objects with ShiftModel.
class NodeFixture {
 public:
  explicit NodeFixture(const NodeFixtureConfig& config = {});

  NodeState& state() { return *state_; }
  NodeExchange& exchange() { return *exchange_; }
  /// What the other node shares.
  NodeContacts& peer() { return peer_contacts_; }
  HostPublication& publication() { return publication_; }
  FrameControl& frame_control() { return frame_control_; }
  const geometry::FixedSpace& space() const { return space_; }
  geometry::Bounds bounds(const Vec3d& position) const;

  /// Lets the node host an object, and returns its index in Host.
  std::uint32_t host(ObjectNumber number, const Vec3d& position);
  messages::PositionRecord position(ObjectNumber number, const Vec3d& position,
                                    std::uint32_t flags = messages::flag_present) const;
  /// From now on the hosted objects do not move.
  void rest() { model_.step = 0; }
  /// Puts an object into the node's RegionObjects, as if the server had sent it.
  void know(ObjectNumber number, const Vec3d& position, std::uint32_t flags = messages::flag_present);

  /// A message to the node; it lives as long as the fixture.
  template <class Record>
  messages::MessageView message(MessageType type, std::span<const Record> records, bool last = true,
                                Endpoint from = Endpoint::server()) {
    return message(type, sizeof(Record), records.size(), std::as_bytes(records), last, from);
  }
  template <class Record>
  messages::MessageView message(MessageType type, const Record& record, Endpoint from = Endpoint::server()) {
    return message(type, std::span<const Record>(&record, 1), true, from);
  }
  messages::MessageView message(MessageType type) { return message(type, 0, 0, {}, true, Endpoint::server()); }
  /// Takes the messages that were sent to the server, or to the other node, since the last call.
  std::vector<LoggedMessage> sent_to_server() { return taken(to_server_.receiver()); }
  std::vector<LoggedMessage> sent_to_peer() { return taken(to_peer_.receiver()); }

 private:
  messages::MessageView message(MessageType type, std::size_t record_bytes, std::size_t count,
                                std::span<const std::byte> records, bool last, Endpoint from);
  static std::vector<LoggedMessage> taken(link::Receiver& receiver);

  geometry::ShapeTable shapes_;
  geometry::FixedSpace space_{{0, 0, 0}, {64, 64, 64}};
  regions::CellGrid grid_{{2, 2, 2}};
  ShiftModel model_;
  link::Channel to_server_, to_peer_;
  FrameControl frame_control_;
  NodeContacts contacts_, peer_contacts_;
  HostPublication publication_;
  std::list<std::vector<std::uint64_t>> messages_;
  std::unique_ptr<NodeState> state_;
  std::unique_ptr<NodeExchange> exchange_;
};

}  // namespace ringfence::nodes::test
