#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dds/description.hpp"
#include "dds/domain.hpp"
#include "dds/link_events.hpp"
#include "dds/node_totals.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/peer_links.hpp"
#include "dds/piece_assembler.hpp"
#include "facade/duplex_channel.hpp"
#include "geometry/shape_table.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "nodes/message_check.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::dds {

/// A World as its node knows it: parameters, the shapes received so far, and the motion model.
///
/// Threads: one.
class JoinedWorld {
 public:
  /// Throws Error if the parameters cannot be met. `terms` are the result of unpack_terms(). `config` outlives it.
  JoinedWorld(std::uint64_t number, const WorldTermsRecord& terms, const NodeServiceConfig& config);

  std::uint64_t number() const noexcept { return number_; }
  const WorldTermsRecord& terms() const noexcept { return terms_; }
  const geometry::FixedSpace& space() const noexcept { return space_; }
  const geometry::ShapeTable& shapes() const noexcept { return shapes_; }
  const MotionModel* model() const noexcept { return model_.get(); }
  /// The region map's table of that epoch, or null if it has not arrived.
  const std::vector<std::byte>* regions(std::uint32_t epoch) const {
    return assembler_.find(PieceKind::regions, 0, epoch);
  }

  /// Adds a piece and processes what is complete. Throws Error if the piece, a shape or the embedder's setup is
  /// invalid.
  void add(const PieceSample& piece);
  /// Whether the motion model exists, or none is needed.
  bool is_ready() const noexcept { return ready_; }

 private:
  void make_model(std::span<const std::byte> setup);
  void remove_shape(ShapeNumber shape);

  std::uint64_t number_;
  WorldTermsRecord terms_;
  const NodeServiceConfig& config_;
  geometry::FixedSpace space_;
  geometry::ShapeTable shapes_;
  std::shared_ptr<const MotionModel> model_;
  PieceAssembler assembler_;
  bool ready_ = false;
};

/// Writes the Presence of a node for a World.
void write_presence(dds_entity_t writer, std::uint64_t incarnation, std::uint64_t world, const std::string& name,
                    NodeState state, const std::string& reason);

/// One membership of a node process in a World: from the announcement to the dismissal.
///
/// The node's role runs in the thread that moves messages between its rings and the links, so a message passes no other
/// thread between the network and the role. The role has one connection for the server and all other nodes, because
/// every message names its source and destination; so the cost does not grow with the number of nodes. Messages for
/// other node processes go over direct links, all others to the process of the World.
///
/// Threads: one.
class NodeSession {
 public:
  /// Adds each complete frame to `totals`.
  NodeSession(const Domain& domain, JoinedWorld& world, dds_entity_t presence, Entity listener_writer,
              const std::string& name, NodeTotals& totals);
  ~NodeSession();
  NodeSession(const NodeSession&) = delete;
  NodeSession& operator=(const NodeSession&) = delete;

  /// Readable while step() may find work on a link.
  int events_descriptor() const noexcept { return events_.descriptor(); }
  /// Whether step() may find work on a link. If not, requests an event for when it does.
  bool has_work();
  /// Announces that the node is ready when it is.
  void announce_when_ready();
  /// Does what can be done now; returns whether that was anything. Throws Error if the World breaks the protocol.
  bool step();
  /// Starts to leave; true if there is nothing to hand over.
  bool leave();
  /// Asks the World whether this node is still assigned. If no parcel arrives within a lease, the session is over.
  void query_assignment();

  bool is_assigned() const noexcept { return role_ != nullptr; }
  /// Whether the node was dismissed, or its link with the World has failed.
  bool is_over() const noexcept { return over_; }
  /// Number of parcels received from the World.
  std::uint64_t received() const noexcept { return channel_to_world_ ? channel_to_world_->received() : 0; }

 private:
  void publish_state(NodeState state);
  bool take_events();
  bool has_news() const noexcept;
  bool arm() noexcept;
  void disarm() noexcept;
  void accept_world();
  void announce_again();
  bool receive_parcels();
  bool deliver(ParcelKind kind, std::uint32_t shapes, std::size_t& offset, std::span<const std::byte> bytes);
  bool assign(const Assignment& assignment);
  bool make_role(const AssignmentRecord& record);
  bool awaits_peers() const noexcept;
  void watch_peers(bool watched);
  bool receive_from_peers();
  void report_failed_peers();
  bool deliver_from_peer(NodeNumber slot, std::span<const std::byte> message);
  bool is_from_peer(NodeNumber slot, std::span<const std::byte> message) const noexcept;
  void send();
  void check_messages() const;
  void send_model_failures();
  void count_frame();

  JoinedWorld& world_;
  NodeTotals& totals_;
  std::uint64_t incarnation_;
  std::string name_;
  dds_entity_t presence_;
  Entity listener_;
  PeerLinks links_;
  std::optional<ParcelChannel> channel_to_world_;  ///< from when the World has opened it
  LinkEvents events_;                              ///< of the link with the World, and of `links_` while they matter
  bool peers_watched_ = false;
  bool armed_ = false;          ///< events of links in shared memory were requested
  std::uint64_t query_ns_ = 0;  ///< time of an assignment query without a reply; 0: none
  NodeState state_ = NodeState::joining;
  std::uint64_t announced_ns_ = 0;  ///< time of the last announcement
  facade::DuplexChannel channel_;
  link::Channel from_peers_;  ///< messages of other nodes; their order with those of the server does not matter
  std::unique_ptr<nodes::CdNodeRole> role_;
  NodeNumber slot_ = 0;
  nodes::MessageLimits limits_;
  std::uint64_t counted_frames_ = 0;                  ///< of the role, in totals_
  std::uint64_t failures_frame_ = ~std::uint64_t{0};  ///< for which the failures of the model were sent
  bool over_ = false;
};

}  // namespace ringfence::dds
