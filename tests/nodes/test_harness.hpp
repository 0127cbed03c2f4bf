#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "geometry/shape_table.hpp"
#include "link/channel.hpp"
#include "link/publication.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "nodes/server/server_role.hpp"
#include "nodes/user/user_role.hpp"

namespace ringfence::nodes::test {

using messages::Endpoint;
using messages::MessageType;

/// A message as it was seen on its way.
struct LoggedMessage {
  Endpoint from, to;
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

/// Stands between two channels: every message passes through the test's hands.
class TappedChannel {
 public:
  TappedChannel(std::size_t ring_bytes, std::size_t delivery_bytes, Endpoint from, Endpoint to)
      : from_(from), to_(to), near_(ring_bytes, nullptr, nullptr), far_(delivery_bytes, nullptr, nullptr) {}
  link::Sender& sender() { return near_.sender(); }
  link::Receiver& receiver() { return far_.receiver(); }
  unsigned period = 1;  ///< in disorder it passes something once in so many rounds
  /// Takes what was sent (of it at most so many messages), lets `tamper` make of it what it likes, delivers that, and
  /// notes it in `log`.
  using Tamper = std::function<void(const LoggedMessage& message, std::vector<std::vector<std::byte>>& instead)>;
  bool pass(const Tamper& tamper, std::vector<LoggedMessage>& log, std::size_t most = ~std::size_t{0});
  /// Delivers what nobody sent.
  void forge(std::span<const std::byte> message);

 private:
  Endpoint from_, to_;
  link::Channel near_, far_;
};

/// What a theatre is built from.
struct HarnessConfig {
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  std::uint32_t nodes = 3;
  regions::CellGrid grid{{2, 2, 1}};
  const MotionModel* model = nullptr;
  std::size_t ring_bytes = 4096;
  std::size_t delivery_bytes = std::size_t{1} << 20;  ///< of the rings behind the test's hands
  double interest = 0;
  Quotas quotas;
  std::uint64_t user_deadline_ns = 0;
  bool shares_memory = false;  ///< server and CD nodes, as where they are in one process
  bool all_publish = true;     ///< where they share memory; else every second one, as where others are elsewhere
};

/// How the roles of a frame take turns: at random, each at a pace of its own, with what is under way held back at
/// random; and which CD nodes are lost in it.
///
/// A node that is lost has stopped before, or stops then, or does not know of it and goes on for some frames, as a
/// thread that was late does.
struct RandomOrder {
  std::mt19937_64* random;
  std::size_t losses = 0;  ///< at random moments; fewer if the frame is over before
  bool late = false;       ///< losses come after the first node has heard that the frame ends
};

/// A server, CD nodes and user nodes in one thread, stepped by hand, every message of theirs seen.
class TestHarness {
 public:
  explicit TestHarness(const HarnessConfig& play);

  ShapeNumber add_shape(const ShapeDescription& shape) { return shapes_.add(shape); }
  // For the next cut.
  void connect(UserNumber user);
  void disconnect(UserNumber user);
  ObjectId spawn(ObjectSpec spec);
  void destroy(ObjectId id);
  void place(ObjectId id, const Pose& pose);
  UserRole& user(UserNumber number) { return *users_.at(number).role; }

  /// The CD node of that number (among those that stand) does nothing more once `messages` more have been sent to or
  /// by it in the next frame; when the frame then gets on no more, the server is told that it is lost.
  void kill(NodeNumber node, std::size_t messages);
  /// So many CD nodes from the frame after the next on, as World::resize has it.
  void resize(std::uint32_t nodes) { resize_to_ = nodes; }
  /// CD nodes that stand.
  std::size_t nodes() const { return active_.size(); }

  /// One frame; log() then holds its messages in an order that respects cause and effect.
  void frame() { frame({}); }
  void frame(const std::optional<RandomOrder>& random_order);
  std::uint64_t frames() const { return order_.completed.load(); }
  std::uint64_t last() const { return frames() - 1; }
  const std::vector<LoggedMessage>& log() const { return log_; }

  const ServerRole& server() const { return *server_; }
  const ObjectTable& table() const { return server_->objects(); }
  /// What the node shares; null unless the play says that they share memory.
  const NodeContacts* node_contacts(NodeNumber node) const { return nodes_[active_[node]].node_contacts.get(); }
  const Host& host(NodeNumber node) const { return nodes_[active_[node]].role->host(); }
  const FrameReport& report() const { return server_->report(last()); }
  std::span<const Contact> contacts() const { return server_->ledger().contacts(last()); }
  std::span<const Contact> ended() const { return server_->ledger().ended(last()); }
  const HarnessConfig& play() const { return config_; }
  /// What user nodes were told to read of others in the last frame, besides each other.
  const std::vector<const Published*>& relays() const { return publications_.relays[last() & 1]; }
  const regions::RegionMap& map() const { return map_; }
  const geometry::FixedSpace& space() const { return space_; }
  const geometry::ShapeTable& shapes() const { return shapes_; }

  /// Who hosts an object, found by asking all roles: the endpoints of those that do. The server's own are those of
  /// which its table says so and that nobody else has.
  std::vector<Endpoint> hosts_of(ObjectNumber number) const;
  /// Requires that every object that can move has exactly one host, the one in the server's table, and that nobody
  /// hosts what is not there; in user/collision deployment, that the host owns the cell that the object stands in.
  void require_one_host_each() const;
  /// Requires that every user node that has done the last frame sees what stands in the cells near its avatars, of what
  /// others host, each once and as it stands, and nothing else; and that what was relayed was counted.
  void require_views() const;

  TappedChannel::Tamper tamper;   ///< sees what user nodes send
  std::function<void()> between;  ///< called each time round in a frame
  TappedChannel& from(UserNumber user) { return *users_.at(user).out; }

 private:
  struct Node;
  Connection add_node(NodeNumber number);
  void connect_peers();
  void grow();
  void retire_lost();
  void retire(std::size_t left);
  bool step_in_order();
  void step_in_random_order(const RandomOrder& random_order);
  void fallback();
  bool pass(Node& node);
  bool is_stepped(std::size_t node) const { return nodes_[node].role != nullptr || nodes_[node].still_runs; }
  bool lose(NodeNumber number, bool still_runs);
  void report_stopped_nodes();

  struct Node {
    std::unique_ptr<TappedChannel> in, out;  ///< to the node, from the node
    std::unique_ptr<NodeContacts> node_contacts;
    std::unique_ptr<NodePublication> publication;
    std::unique_ptr<CdNodeRole> role;
    std::unique_ptr<CdNodeRole> stopped_role;  ///< what it was, when it is no more: its memory stays
    bool still_runs = false;                   ///< though it is lost
    unsigned period = 1;                       ///< in disorder it is stepped once in so many rounds; 0: not any more
    std::size_t messages = ~std::size_t{0};    ///< that it still lives to see
  };
  struct User {
    std::unique_ptr<TappedChannel> in, out;  ///< to the user, from the user
    std::unique_ptr<link::Publication> publication;
    std::unique_ptr<UserRole> role;
  };

  HarnessConfig config_;
  geometry::ShapeTable shapes_;
  geometry::FixedSpace space_{{0, 0, 0}, {64, 64, 64}};
  regions::RegionMap map_;
  Publications publications_;
  link::Publication relay_;
  FrameOrder order_;
  std::vector<Request> requests_;
  std::vector<Node> nodes_;          ///< all that there ever were
  std::vector<std::size_t> active_;  ///< indices into nodes_, by number
  std::map<std::pair<std::size_t, std::size_t>, std::unique_ptr<TappedChannel>> peers_;  ///< by indices into nodes_
  std::optional<ServerRole> server_;
  std::map<UserNumber, User> users_;
  std::set<UserNumber> leaving_;
  std::uint32_t resize_to_ = 0;  ///< 0: as they are
  std::vector<LoggedMessage> log_;
  std::uint32_t generation_ = 0;
  ObjectNumber number_ = 0;
};

}  // namespace ringfence::nodes::test
