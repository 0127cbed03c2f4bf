#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/halo_exchange.hpp"
#include "nodes/cd_node/migration.hpp"
#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

/// Moves the objects that a CD node hosts, batch by batch, reports them to the server (`node_state`, `replica`) and
/// publishes them for the user nodes.
///
/// The changes of a batch are processed while they are in the cache: RegionObjects, HaloExchange and Migration receive
/// them, and the server receives its share of them while the next batch is moved.
///
/// Only begin(), move(), place() and publish() use memory that the node shares with others.
///
/// Threads: belongs to the CD node. Allocates nothing in steady state.
class Mover {
 public:
  /// All outlive the mover.
  Mover(NodeState& state, HaloExchange& halo, Migration& migration);

  /// Starts the move of NodeState::frame.
  void begin();
  /// Moves and reports. Returns false if the ring is full; then call it again.
  bool move();
  /// Whether all is moved and reported.
  bool done() const noexcept { return states_run_.done(); }
  /// Publishes the partial report, so that another message can be sent to the server.
  void flush();
  /// Publishes the hosted objects, if the server wants it, while it receives the states of the other nodes. The poses
  /// are final, because they have been reported.
  void publish();
  /// Sends `published` after publish(). Returns whether nothing is left to send.
  bool send_published() { return state_.send_empty(published_run_, messages::MessageType::published); }

 private:
  enum class Report : std::uint8_t { none, state, replica };
  /// What was computed of a changed object.
  struct Batch {
    std::array<geometry::Bounds, Host::batch> bounds;
    std::array<geometry::FixedPoint, Host::batch> points;  ///< positions
    std::array<std::uint32_t, Host::batch> flags;          ///< ObjectFlag bits of the records
    std::array<Report, Host::batch> reports;               ///< what the server receives of the change
  };
  /// A change that is reported after the last replica.
  struct Change {
    std::uint32_t hosted;  ///< index in Host
    std::uint32_t flags;
    geometry::Bounds bounds;
  };

  bool report_batch();
  void bound_batch();
  void place_batch();
  void place(std::size_t i);
  void rest(std::size_t i);
  bool report_state(std::uint32_t hosted, std::uint32_t flags, const geometry::Bounds& bounds);
  bool report_replica(std::uint32_t hosted);
  bool report_changes();
  void flush_replicas();
  void note_cells();
  std::uint32_t publication_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept;
  std::size_t report_bytes() const noexcept;

  NodeState& state_;
  HaloExchange& halo_;
  Migration& migration_;
  std::span<const std::uint32_t> changed_;  ///< of the last batch: indices in Host
  Batch batch_;                             ///< parallel to changed_
  std::size_t next_ = 0;                    ///< next of changed_ to report
  std::size_t unreported_ = 0;              ///< how many of them are still to be reported
  std::vector<Change> changes_;             ///< of the frame, if the server receives replicas
  std::size_t next_change_ = 0;             ///< next of them to report
  bool publishes_ = false;                  ///< in this frame
  messages::RunWriter states_run_, replicas_run_;
  messages::RunSender published_run_;
};

}  // namespace ringfence::nodes
