#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "facade/node_pool.hpp"
#include "geometry/shape_table.hpp"
#include "link/channel.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "nodes/server/server_role.hpp"
#include "nodes/tapped_channel.hpp"
#include "nodes/user/user_role.hpp"
#include "nodes/user/user_thread_role.hpp"

namespace ringfence::nodes::test {

/// Configuration of a harness.
struct HarnessConfig {
  Deployment deployment = Deployment::user_collision;
  Placement placement = Placement::server;
  std::uint32_t nodes = 3;
  regions::CellGrid grid{{2, 2, 1}};
  const MotionModel* model = nullptr;
  std::size_t ring_bytes = 4096;
  /// Size of the receivers' halves. Each harness clears them: with 1 MiB that is most of the time of these tests.
  std::size_t delivery_bytes = std::size_t{1} << 17;
  double interest = 0;
  std::uint32_t deepest_contacts = 0;
  Quotas quotas;
  std::uint64_t user_deadline_ns = 0;
  std::uint64_t node_deadline_ns = 0;
  bool shares_memory = false;  ///< server and CD nodes share memory, as in one process
  bool nodes_may_be_lost = true;
};

/// Steps the roles of a frame in random order, each at its own period, with messages delayed at random; and loses CD
/// nodes.
///
/// A lost node has stopped before, stops at that moment, or continues to run for some frames, like a slow thread.
struct RandomOrder {
  std::mt19937_64* random;
  std::size_t losses = 0;  ///< at random moments; fewer if the frame ends first
  bool late = false;       ///< losses happen after the first node has received the end of the frame
};

/// A hit of a query, with its object.
struct FoundHit {
  std::uint32_t query = 0;
  double place = 0;
  ObjectNumber number = 0;  ///< 0 for QueryKind::cast_any
  std::uint32_t triangle = 0;
  Vec3d point, normal;
  bool operator==(const FoundHit&) const = default;
};

/// A server, CD nodes and user nodes in one thread, stepped by hand; all their messages are recorded. With
/// shares_memory, words that replace messages are recorded like these.
class TestHarness {
 public:
  explicit TestHarness(const HarnessConfig& config);

  ShapeId add_shape(const ShapeDescription& shape) { return ShapeId(shapes_.add(shape)); }
  // For the next cut.
  void connect(UserNumber user);
  void disconnect(UserNumber user);
  ObjectId spawn(ObjectSpec spec);
  void destroy(ObjectId id);
  void place(ObjectId id, const Pose& pose);
  UserRole& user(UserNumber number) { return *users_.at(number).role; }
  /// The CD nodes answer these queries in each frame from the next one on.
  void ask(std::vector<messages::QueryRecord> queries);

  // CD nodes are counted from 0, by ascending slot: without losses that is the slot.
  /// The node stops after `messages` more messages to or from it in the next frame; when the frame makes no progress
  /// any more, the server is informed of the loss.
  void kill(std::size_t node, std::size_t messages);
  /// The node stops inside a read gate in the next frame and is lost.
  enum class GateOf { ghost_updates, lists };
  void stop_inside(std::size_t node, GateOf gate);
  /// Number of CD nodes from the frame after the next on, like World::resize.
  void resize(std::uint32_t nodes) { resize_to_ = nodes; }
  /// Number of CD nodes.
  std::size_t nodes() const { return pool_->size(); }
  const facade::NodePool& pool() const { return *pool_; }

  /// Runs one frame; log() then holds its messages in causal order.
  void frame() { frame({}); }
  void frame(const std::optional<RandomOrder>& random_order);
  std::uint64_t frames() const { return order_.completed.load(); }
  std::uint64_t last() const { return frames() - 1; }
  const std::vector<LoggedMessage>& log() const { return log_; }

  const ServerRole& server() const { return *server_; }
  const ObjectTable& table() const { return server_->objects(); }
  /// The node's shared contacts; null without shares_memory.
  const NodeContacts* node_contacts(std::size_t node) const { return node_at(node).server.first.node_contacts; }
  const Host& host(std::size_t node) const { return node_at(node).role->host(); }
  const FrameReport& report() const { return server_->report(last()); }
  std::span<const Contact> contacts() const { return server_->ledger().contacts(last()); }
  std::span<const Contact> ended() const { return server_->ledger().ended(last()); }
  /// What all nodes together answered in the last frame, in order of query, place and number; only the first hit of a
  /// query without a list. Empty if a node was lost.
  const std::optional<std::vector<FoundHit>>& answers() const { return answers_; }
  const HarnessConfig& config() const { return config_; }
  /// The publications that user nodes had to read in the last frame, besides their own.
  const std::vector<const Published*>& relays() const { return publications_.relays[last() & 1]; }
  const regions::RegionMap& map() const { return map_; }
  const geometry::FixedSpace& space() const { return space_; }
  const geometry::ShapeTable& shapes() const { return shapes_; }

  /// All hosts of an object, found in the roles themselves. The server is one if its table says so and no other role
  /// hosts the object.
  std::vector<Endpoint> hosts_of(ObjectNumber number) const;
  /// Requires that every object that can move has exactly one host, that of the server's table, and that no role hosts
  /// an object that is gone; in user/collision deployment, that the host owns the cell of the object's position.
  void require_one_host_each() const;
  /// Requires that every user node that completed the last frame sees the objects of others in the cells near its
  /// avatars, each once and at its current pose, and nothing else; and that the relayed states were counted.
  void require_views() const;

  TappedChannel::Tamper tamper;        ///< sees what user nodes send
  TappedChannel::Tamper tamper_nodes;  ///< sees what CD nodes send to the server, except in frames in random order
  std::function<void()> between;       ///< called once per round of a frame
  TappedChannel& from(UserNumber user) { return *users_.at(user).out; }

 private:
  /// The channel between the server and a CD node.
  struct ServerChannel;
  /// What the test does with a CD node.
  struct Control {
    bool stopped = false;                    ///< it is lost or has left, so it is not stepped
    bool still_runs = false;                 ///< it is stepped although it is lost
    unsigned period = 1;                     ///< in random order it is stepped once in this many rounds; 0: never again
    std::size_t messages = ~std::size_t{0};  ///< number of messages until it stops
    ReadGate* stops_inside = nullptr;        ///< the node stops when it has entered this gate
    FrameMark<ReportedStep> reached;         ///< of what it has reported, the last that is in the log
  };

  ExchangeKind exchange_kind() const { return config_.shares_memory ? ExchangeKind::shared : ExchangeKind::messages; }
  facade::NodePoolSetup pool_setup();
  facade::PoolChannel connect_to_server(const facade::PoolNode& node);
  facade::PoolChannel connect_nodes(const facade::PoolNode& first, const facade::PoolNode& second);
  facade::PoolNode& node_at(std::size_t node) const;
  std::vector<facade::PoolNode*> all_nodes() const;
  static ServerChannel& channel_of(const facade::PoolNode& node);
  Control& control(const facade::PoolNode& node) { return controls_[node.id]; }
  bool is_stepped(NodeNumber id) const { return !controls_[id].stopped || controls_[id].still_runs; }
  void request_join(facade::PoolNode& node, base::SystemVector<Request>::iterator where);
  void merge_answers();
  void resize_nodes();
  void remove_gone_nodes();
  bool step_in_order();
  void step_in_random_order(const RandomOrder& random_order);
  void fallback();
  bool pass(const facade::PoolNode& node);
  void count_messages(const facade::PoolNode& node, std::size_t messages);
  bool step_node(const facade::PoolNode& node);
  bool step_server();
  bool lose(const facade::PoolNode& node, bool still_runs);
  void report_stopped_nodes();

  struct User {
    std::unique_ptr<TappedChannel> in, out;  ///< to the user, from the user
    std::unique_ptr<HostPublication> publication;
    std::unique_ptr<InterestReader> reader;
    std::unique_ptr<UserRole> role;
    std::unique_ptr<UserThreadRole> thread;  ///< each user node has a connection of its own
  };

  HarnessConfig config_;
  geometry::ShapeTable shapes_;
  geometry::FixedSpace space_{{0, 0, 0}, {64, 64, 64}};
  regions::RegionMap map_;
  Publications publications_;
  Publication relay_;
  FrameOrder order_;
  FrameControl frame_control_;
  base::SystemVector<Request> requests_;
  std::vector<Control> controls_;                                                      ///< by id
  std::map<std::pair<NodeNumber, NodeNumber>, std::shared_ptr<TappedChannel>> peers_;  ///< by ids: from, to
  std::optional<facade::NodePool> pool_;
  std::optional<ServerRole> server_;
  std::map<UserNumber, User> users_;
  std::set<UserNumber> leaving_;
  std::uint32_t resize_to_ = 0;  ///< 0: no change
  std::vector<LoggedMessage> log_;
  std::list<std::vector<messages::QueryRecord>> queries_;  ///< the last is asked; lost nodes may read the others
  std::optional<std::vector<FoundHit>> answers_;
  std::chrono::steady_clock::time_point frame_began_;
  std::uint32_t generation_ = 0;
  ObjectNumber number_ = 0;
};

}  // namespace ringfence::nodes::test
