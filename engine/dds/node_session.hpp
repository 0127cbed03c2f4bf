#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dds/description.hpp"
#include "dds/domain.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/piece_assembler.hpp"
#include "facade/duplex_channel.hpp"
#include "geometry/shape_table.hpp"
#include "link/doorbell.hpp"
#include "nodes/cd_node/cd_node_role.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::dds {

/// A World as a node knows it: its terms, its shapes as far as they have come, and what moves its objects.
///
/// Threads: one.
class JoinedWorld {
 public:
  /// Throws Error where the terms cannot be met. `config` outlives it.
  JoinedWorld(std::uint64_t number, const WorldTermsRecord& terms, const NodeServiceConfig& config);

  std::uint64_t number() const noexcept { return number_; }
  const WorldTermsRecord& terms() const noexcept { return terms_; }
  const geometry::FixedSpace& space() const noexcept { return space_; }
  const geometry::ShapeTable& shapes() const noexcept { return shapes_; }
  const MotionModel* model() const noexcept { return model_.get(); }
  /// The region map's table under that epoch, or null where it has not come yet.
  const std::vector<std::byte>* regions(std::uint32_t epoch) const {
    return assembler_.find(PieceKind::regions, 0, epoch);
  }

  /// Takes a piece and does what can be done with it. Throws Error where a shape or the embedder's own will not do.
  void add(const PieceSample& piece);
  /// Whether the motion model is there, or none is needed.
  bool is_ready() const noexcept { return ready_; }

 private:
  void make_model(std::span<const std::byte> setup);

  std::uint64_t number_;
  WorldTermsRecord terms_;
  const NodeServiceConfig& config_;
  geometry::FixedSpace space_;
  geometry::ShapeTable shapes_;
  std::shared_ptr<const MotionModel> model_;
  PieceAssembler assembler_;
  bool ready_ = false;
};

/// A node's time under one number in the World's books: from saying that it is there to hearing that it has no seat.
///
/// The node's role is in the thread that carries between its rings and the parcels: a frame's message passes no other
/// thread on its way from the network to the role. It has one line for the server and all other nodes, since the
/// messages themselves say whom they are from and for; so what a node costs here does not grow with their number.
///
/// Threads: one, but for the hooks.
class NodeSession {
 public:
  /// `hook` is called when a parcel has come, and when others come or go; it outlives it.
  NodeSession(Domain& domain, JoinedWorld& world, dds_entity_t presence, dds_entity_t up, const std::string& name,
              const Domain::Hook& hook);
  ~NodeSession();
  NodeSession(const NodeSession&) = delete;
  NodeSession& operator=(const NodeSession&) = delete;

  /// Says how it stands where that has changed. `up_matched`: the World hears what the node says.
  void update_membership(bool up_matched);
  /// Does what can be done now; whether that was anything.
  bool step(bool parcels_wait);
  /// Wants to leave: true where there is nothing to hand over.
  bool leave();
  void refuse(const std::string& reason);
  /// Asks whether it has its seat still.
  void ask() { parcel_channel_.send_unnumbered(ParcelKind::assignment_query); }

  bool is_assigned() const noexcept { return role_ != nullptr; }
  /// Has lost its seat, or its way.
  bool is_over() const noexcept { return over_; }

 private:
  void say(NodeState state, const std::string& reason = {});
  bool deliver(ParcelKind kind, std::uint32_t shapes, std::size_t& offset, std::span<const std::byte> bytes);
  bool assign(const AssignmentRecord& assignment_record);

  JoinedWorld& world_;
  std::uint64_t incarnation_;
  std::string name_;
  dds_entity_t presence_;
  Entity down_;
  ParcelChannel parcel_channel_;
  NodeState state_ = NodeState::joining;
  facade::DuplexChannel channel_;
  std::unique_ptr<nodes::CdNodeRole> role_;
  bool over_ = false;
};

}  // namespace ringfence::dds
