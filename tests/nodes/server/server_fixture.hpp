#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "geometry/shape_table.hpp"
#include "link/channel.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes::test {

using messages::Endpoint;
using messages::MessageType;

/// A message that the server sent.
struct SentMessage {
  messages::Header header;
  std::vector<std::byte> bytes;  ///< header included
  MessageType type() const { return static_cast<MessageType>(header.type); }
  template <class Record>
  Record record(std::size_t i) const {
    Record record;
    std::memcpy(&record, bytes.data() + sizeof(messages::Header) + i * header.record_bytes, sizeof record);
    return record;
  }
};

/// Configuration of a fixture. The world is a cube of 64 m; with two nodes the first owns x < 32.
struct FixtureConfig {
  NodeNumber nodes = 2;
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  const MotionModel* model = nullptr;
  bool shares_memory = false;  ///< server and CD nodes share contacts, hosts and publications
  double interest = 0;
  Quotas quotas{};
  bool nodes_may_be_lost = true;
  std::uint64_t node_deadline_ns = 0;
  std::uint64_t user_deadline_ns = 0;
};

/// The data of a server in frame 1 whose peers are the test: it reads what a part sends to each of them and writes what
/// they send. There is no role, so a test calls one part of the server alone.
class ServerFixture {
 public:
  explicit ServerFixture(const FixtureConfig& config = {});

  ServerState& state() { return *state_; }
  ServerExchange& exchange() { return *exchange_; }
  FrameOrder& order() { return order_; }
  Publications& publications() { return publications_; }
  /// The end of a new connection that a server would hold.
  Connection connection(Endpoint peer);
  /// What a CD node of this process shares; valid with shares_memory.
  FrameControl& frame_control() { return frame_control_; }
  NodeContacts& node_contacts(NodeNumber node) { return peers_.at(Endpoint::node(node).value)->node_contacts; }
  HostPublication& publication(NodeNumber node) { return *peers_.at(Endpoint::node(node).value)->publication; }
  /// The objects that a CD node of this process hosts.
  Host& host(NodeNumber node) { return peers_.at(Endpoint::node(node).value)->host; }

  /// Connects a user node without a request.
  void connect(UserNumber user);
  /// Adds a ball with a diameter of 1 m, with its host and bounds, and returns its slot. A node of this process hosts
  /// it.
  std::uint32_t add(const Vec3d& position, Endpoint host, Category category = Category::active, UserNumber user = 0);
  /// Takes the messages that were sent to a peer since the last call.
  std::vector<SentMessage> sent_to(Endpoint peer);
  /// A CD node of this process reports a step, with what its NodeContacts::report has.
  void report(NodeNumber node, ReportedStep step);
  /// Leaves no room for messages to a peer, until sent_to() is called.
  void fill(Endpoint peer);
  /// Sends a message from a peer, the last of its run.
  template <class Record>
  void send(Endpoint from, MessageType type, std::span<const Record> records) {
    send(from, type, sizeof(Record), records.size(), std::as_bytes(records));
  }
  template <class Record>
  void send(Endpoint from, MessageType type, const Record& record) {
    send(from, type, std::span<const Record>(&record, 1));
  }
  void send(Endpoint from, MessageType type) { send(from, type, 0, 0, {}); }
  /// The same from the thread of a user node, for all user nodes of the thread.
  void send_for_all(UserNumber user, MessageType type) { send(Endpoint::user(user), type, 0, 0, {}, true); }
  void send_for_all(UserNumber user, const messages::NodeFrameStats& stats) {
    const std::span<const messages::NodeFrameStats> records(&stats, 1);
    send(Endpoint::user(user), MessageType::frame_done, sizeof stats, 1, std::as_bytes(records), true);
  }

 private:
  struct Peer {
    link::Channel to_peer{std::size_t{1} << 16, nullptr, nullptr}, from_peer{std::size_t{1} << 16, nullptr, nullptr};
    Host host{nullptr, 16};
    NodeContacts node_contacts;
    std::unique_ptr<HostPublication> publication;
  };

  void send(Endpoint from, MessageType type, std::size_t record_bytes, std::size_t count,
            std::span<const std::byte> records, bool for_all = false);

  FixtureConfig config_;
  geometry::ShapeTable shapes_;
  geometry::FixedSpace space_{{0, 0, 0}, {64, 64, 64}};
  regions::CellGrid grid_{{2, 2, 1}};
  Publications publications_;
  Publication relay_;
  FrameOrder order_;
  FrameControl frame_control_;
  std::map<std::uint32_t, std::unique_ptr<Peer>> peers_;  ///< by Endpoint::value
  std::unique_ptr<ServerState> state_;
  std::unique_ptr<ServerExchange> exchange_;
  ObjectNumber numbers_ = 0;
};

}  // namespace ringfence::nodes::test
