#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/numbers.hpp"
#include "dds/description.hpp"
#include "dds/domain.hpp"
#include "dds/link_events.hpp"
#include "dds/parcel_channel.hpp"
#include "facade/remote_nodes.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::dds {

/// The World's side of a cluster: membership, and the bridge between the rings of the server's process and the parcels
/// of the network.
///
/// Nodes announce themselves by Presence, and the World opens a link to each. Changes of membership take effect when
/// the World asks for them between frames; only a loss is reported to the server within the frame. Messages between two
/// node processes do not pass through this object: each node is assigned with the addresses of the others. If a node
/// reports that it cannot exchange messages with another one, the other one is lost.
///
/// Threads, call order and failures: see RemoteNodes.
class ClusterNodes final : public RemoteNodes {
 public:
  /// Joins the DDS domain. Throws Error if that fails.
  explicit ClusterNodes(ClusterConfig config);
  ~ClusterNodes() override;

  std::uint32_t domain() const noexcept { return domain_.number(); }
  /// Call it between frames.
  ClusterReport report() const;

  void open(const WorldParameters& terms) override;
  void add_shape(ShapeNumber shape, const ShapeDescription& description) override;
  void remove_shape(ShapeNumber shape) override;
  std::vector<ModelFailure> take_model_failures() override;
  std::vector<MemberId> wait_for_nodes(std::uint32_t nodes) override;
  std::vector<MemberId> arrivals() override;
  bool is_leaving(MemberId member) override;
  void assign(nodes::ServerRole& server, std::span<const NodeAssignment> assignments,
              const regions::RegionMap& map) override;
  facade::Steppable bridge() override { return facade::Steppable::of(*this); }
  void close() noexcept override;

  /// The step of the bridge.
  nodes::Step step();

 private:
  /// A process that has announced itself.
  struct Node {
    std::uint64_t incarnation = 0;
    std::string name;
    std::string reason;  ///< Presence::reason
    bool fits = false;   ///< same version, byte order, record layout and release
    std::atomic<NodeState> state{NodeState::joining};
    std::atomic<bool> gone{false};  ///< its lease has expired, or it has announced its end
    bool refusal_logged = false;
    bool dismissed = false;  ///< was assigned before; it is not assigned again
    bool assigned = false;
    std::unique_ptr<ParcelChannel> parcel_channel;  ///< null: there is no link, or no longer
    std::uint64_t connected_ns = 0;                 ///< time of the last attempt to open the link
    NodeNumber slot = 0;
    NodeNumber id = 0;
    nodes::Connection server;
    /// Its ends of the connections with the nodes in this process, with their slots. Nearly always empty.
    std::vector<std::pair<NodeNumber, nodes::Connection>> peers;
    bool lost = false;    ///< its loss was reported to the server
    bool broken = false;  ///< its link has failed, or a message breaks the protocol
    // Times for ClusterReport::changes; 0: not yet.
    std::uint64_t seen_ns = 0;  ///< of its first announcement
    std::uint64_t asked_to_leave_ns = 0;
    std::uint64_t assigned_ns = 0;
    std::uint64_t last_parcel_ns = 0;               ///< of its last parcel
    std::uint64_t lost_ns = 0;                      ///< when the loss was reported to the server
    std::atomic<std::uint64_t> first_parcel_ns{0};  ///< of its first parcel after the assignment
    bool join_noted = false;                        ///< its join is in ClusterReport::changes
  };

  bool publish_terms();
  void note_presence();
  void note_presence(const PresenceSample& sample, const dds_sample_info_t& info);
  void note_listeners();
  LinkAddress address_of(std::uint64_t incarnation);
  std::vector<PeerRecord> peers_of(std::size_t slot);
  void note_assignment(Node& node);
  bool is_of_another_world(const PresenceSample& sample) const noexcept;
  static std::string describe_refusal(const Node& node);
  void connect(Node& node);
  bool is_ready(const Node& node) const noexcept;
  void ring_server();
  void log(LogLevel level, const std::string& line) const;
  void update_membership();
  bool report_losses();
  bool receive(Node& node);
  bool deliver(Node& from, ParcelKind kind, std::size_t& offset, std::span<const std::byte> bytes);
  bool deliver_message(Node& from, std::span<const std::byte> message);
  void note_peer_failure(Node& from, std::span<const std::byte> bytes);
  void note_model_failure(Node& from, std::span<const std::byte> bytes);
  bool is_from_node(const Node& from, NodeNumber to, std::span<const std::byte> message) const noexcept;
  bool take_events();
  bool arm() noexcept;
  void disarm() noexcept;
  bool carry(Node& node);
  void publish(Node& node);
  void dismiss(Node& node);
  void note_join(Node& node);
  void add_change(MemberChange::Kind kind, const Node& node, std::uint64_t at_ns, double before_ms, double after_ms);

  ClusterConfig config_;
  std::uint64_t world_;
  WorldTermsRecord terms_record_;
  std::atomic<link::Doorbell*> server_bell_{nullptr};
  std::atomic<bool> presence_waits_{false};
  std::atomic<bool> member_is_gone_{false};

  // Taken by the World's thread, and by the server's thread when a Presence has arrived. Never taken by threads of
  // Cyclone DDS.
  mutable std::mutex mutex_;
  std::condition_variable noted_;
  std::map<std::uint64_t, std::shared_ptr<Node>> nodes_;  ///< by incarnation
  bool overflow_logged_ = false;                          ///< that announcements were ignored
  /// Where a node listens for links of other nodes; its host is known when DDS has discovered its participant.
  struct Listening {
    LinkAddress address;
    dds_instance_handle_t publication;  ///< of the writer of its Listener
  };
  std::map<std::uint64_t, Listening> listening_;  ///< by incarnation

  // Set between frames by the World's thread, used in a frame by the bridge.
  nodes::ServerRole* server_ = nullptr;
  std::vector<std::shared_ptr<Node>> assigned_by_slot_;  ///< null: the slot is free, or its node is in this process
  std::unordered_map<std::uint64_t, Node*> assigned_by_incarnation_;
  std::uint32_t shapes_ = 0;
  std::vector<std::uint32_t> shape_parts_;    ///< by shape: number of pieces
  std::vector<ModelFailure> model_failures_;  ///< since the last take_model_failures(); under mutex_
  std::uint32_t published_map_epoch_ = 0;
  std::uint32_t steps_without_events_ = 0;
  bool armed_ = false;   ///< events of links in shared memory were requested
  bool losses_ = false;  ///< there may be losses that were not reported to the server
  ClusterReport totals_;
  std::atomic<std::uint64_t> stale_parcels_{0};

  LinkEvents events_;  ///< of the links of all nodes; their tags are incarnations
  Domain::Hook presence_hook_;
  Domain domain_;
  Entity presence_;
  Entity terms_;
  Entity pieces_;
  Entity listeners_;
};

}  // namespace ringfence::dds
