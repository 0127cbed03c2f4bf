#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/pair_sort.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "messages/run.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/cd_node/region_objects.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/output_merge.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/host.hpp"
#include "nodes/message_check.hpp"
#include "nodes/role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"
#include "ringfence/fault.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// Configuration of a CD node. The pointers outlive the role.
struct CdNodeSetup {
  NodeNumber node = 0;  ///< its slot
  const geometry::ShapeTable* shapes = nullptr;
  const geometry::FixedSpace* space = nullptr;
  const MotionModel* model = nullptr;  ///< null: nothing moves by itself
  Placement placement = Placement::server;
  bool hosts = true;  ///< user/collision deployment: the node hosts objects, so it keeps the contacts that it finds
  std::array<std::uint32_t, 32> layer_masks{};  ///< which layers each layer collides with
  bool keep_resting = true;                     ///< see WorldConfig
  bool shares_thread = false;         ///< other roles run on its thread, so its CPU time is measured as busy time
  telemetry::Track* track = nullptr;  ///< null: no timeline
  bool remember_axes = true;          ///< see narrow_phase::NarrowPhase
  /// The node may be lost, so its host-owned states are also copied where the server can read them.
  bool may_be_lost = true;
  /// Keeps states in shared memory instead of sending them to the server, and exchanges ghosts with its peers if all of
  /// them share memory (placement region)
  bool keeps_host_owned_states = true;
  regions::CellGrid interest_grid;  ///< cells of its publication, if the server connection has one
  std::size_t objects = 0;          ///< number to reserve for
  std::size_t pairs = 0;            ///< number to reserve for
  FaultRelease* faults = nullptr;   ///< ends an injected stop; null: the node stops only between two steps
  /// Object slots are below this number. Checked if the server is in another process.
  std::uint32_t max_slots = std::numeric_limits<std::uint32_t>::max();
  Connection server;
  std::vector<Connection> peers;  ///< by slot; the node's own entry and those of free slots are empty
};

/// A collision detection node. It owns regions and tests the candidate pairs assigned to it, each once. In
/// user/collision deployment it also hosts the objects of its regions: it moves them and responds to their contacts.
///
/// A frame, in the order of its messages: frame_begin; move hosted objects batch by batch, report them to the server
/// (node_state) and to the peers that share memory, publish them for user nodes (published); receive the other objects
/// of its region (M2) and the pairs to test, or sweep for them, and test them as they arrive; send the contacts (M3);
/// receive the contacts of hosted objects (M4); hand over objects that crossed a border (M5); frame_done.
///
/// Threads: one thread at a time steps it. Never blocks, never throws; does not allocate in steady state.
class CdNodeRole {
 public:
  CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map);

  Step step();

  /// Sets the node's slot and its connections to the other nodes, by slot. Between frames, while no thread steps the
  /// role.
  void assign(NodeNumber node, const std::vector<Connection>& peers);

  CdNodeRole(const CdNodeRole&) = delete;
  CdNodeRole& operator=(const CdNodeRole&) = delete;

  /// Injects a fault; its node number is ignored. Between frames, while no thread steps the role; the last call counts.
  void fail(const Fault& fault) noexcept { fault_.set(fault); }

  /// The objects hosted after the last frame. Only while no frame is running.
  const Host& host() const noexcept { return host_; }
  /// Whether the node is between frames, so that assign() may be called.
  bool is_between_frames() const noexcept { return stage_ == Stage::waiting; }
  /// Number of messages from other processes that were discarded because they break the protocol. If it is not 0, such
  /// a process is faulty, and the frame may never end.
  std::uint64_t invalid_messages() const noexcept { return invalid_messages_; }

 private:
  enum class Stage : std::uint8_t { waiting, moving, gathering, colliding, ending, handing_over, settling, reporting };

  bool receive_from(Connection& connection);
  bool receive_from_peers();
  bool is_late(const messages::MessageView& message) const noexcept;
  bool is_acceptable(const messages::MessageView& message) const;
  bool is_expected(const messages::MessageView& message) const;
  bool is_loss_expected(const messages::MessageView& message) const noexcept;
  bool is_map_expected(const messages::MessageView& message) const;
  bool knows_pairs(const messages::MessageView& message) const noexcept;
  bool knows_contacts(const messages::MessageView& message) const noexcept;
  void receive(const messages::MessageView& message);
  void begin(std::uint64_t frame);
  bool shares_states() const noexcept;
  bool move();
  void bound_batch();
  void place_batch();
  void rest(std::size_t i);
  regions::Coverage cover_of(const geometry::Bounds& bounds) const noexcept;
  void place(std::size_t i);
  void write_own_move(std::size_t i, std::byte* where);
  void note_cells();
  std::uint32_t relay_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept;
  void publish();
  bool send_published();
  void add_ghost_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying, std::uint32_t was);
  void receive_ghosts();
  void receive_positions(const messages::MessageView& message);
  void apply_position(const messages::PositionRecord& record, bool gone);
  void apply_ghost(const messages::PositionRecord& record, bool gone);
  void receive_pairs(const messages::MessageView& message);
  void receive_corrections(const messages::MessageView& message);
  void receive_contacts(const messages::MessageView& message);
  void receive_owners(const messages::MessageView& message);
  void receive_lost(const messages::LostRecord& record);
  void discard_tests();
  bool fails_here() noexcept;
  bool answer_probe();
  void drop_leaving_objects(std::size_t peer);
  void detect();
  void sweep();
  void test_pairs();
  void add_hits(std::span<const narrow_phase::PairContact> found);
  void count_kinds();
  void list_contacts();
  void compare_contacts();
  void list_notified_hosts(std::uint32_t position);
  /// Whether the node's model reads the contacts that the node finds.
  bool keeps_contacts() const noexcept { return setup_.hosts && host_.uses_contacts(); }
  void finish_contacts();
  void confirm_begins();
  void add_peer_contacts();
  NextHost next_host(const messages::PositionRecord& record) const noexcept;
  bool is_in_own_region(const Vec3d& position) const noexcept;
  void list_leaving_objects();
  bool advance();
  bool send_collisions();
  bool send_changes();
  messages::ChangeRecord change(std::size_t i) const noexcept;
  bool send_hand_overs();
  bool send_kinds();
  bool send_frame_done();
  std::uint64_t cpu_spent() const noexcept;
  messages::RunHeader head(messages::MessageType type, messages::Endpoint to) const noexcept;

  CdNodeSetup setup_;
  messages::Endpoint self_;
  regions::RegionMap map_;
  geometry::Bounds interior_;  ///< a box that is entirely in the node's region and covers most of it
  bool map_fits_ = true;       ///< every owner is a present node; if not, another map arrives before the next frame
  FaultPoint fault_;
  Host host_;
  RegionObjects region_objects_;
  broad_phase::SweepAndPrune sweep_;
  narrow_phase::NarrowPhase narrow_;

  Stage stage_ = Stage::waiting;
  std::uint64_t invalid_messages_ = 0;
  std::uint64_t frame_ = 0;
  bool positions_received_ = false;
  bool pairs_received_ = false;
  bool contacts_received_ = false;
  bool frame_end_received_ = false;
  std::uint64_t hand_overs_expected_ = 0;
  std::uint64_t hand_overs_received_ = 0;
  std::vector<std::uint64_t> hand_overs_received_from_;  ///< hand-overs by peer
  std::vector<std::uint8_t> lost_;                       ///< by peer: lost in this frame

  static constexpr std::size_t pairs_per_test = 4096;

  std::vector<geometry::CandidatePair> pairs_;         ///< indices into region_objects_; not yet tested
  base::FlatList<geometry::CandidatePair> hits_;       ///< pairs in contact, in the order of detection
  base::FlatList<narrow_phase::PairContact> touches_;  ///< parallel to hits_
  NodeContacts own_contacts_;                          ///< used if the server cannot read shared memory
  NodeContacts* node_contacts_;                        ///< contacts in order of (a, b)
  bool keeps_host_owned_ = false;                      ///< does not report states that only the host needs
  std::size_t next_hit_ = 0;                           ///< next hit to send
  std::uint64_t candidates_ = 0;
  std::uint64_t tested_ = 0;
  std::uint64_t failed_supports_ = 0;
  std::vector<messages::KindRecord> kinds_;
  std::span<const std::uint32_t> changed_;  ///< of the last batch
  std::size_t next_changed_ = 0;            ///< next changed object to send
  std::size_t reported_changes_ = 0;        ///< number of changes reported to the server
  std::array<geometry::Bounds, Host::batch> changed_bounds_;
  std::array<geometry::FixedPoint, Host::batch> changed_points_;  ///< fixed-point positions
  std::array<std::uint32_t, Host::batch> changed_flags_;          ///< ObjectFlag bits of the records
  std::array<bool, Host::batch> reports_change_;                  ///< whether the change is reported to the server
  bool publishes_ = false;                                        ///< in this frame
  struct LeavingObject {
    ObjectNumber number;
    NodeNumber next;  ///< next host
  };
  base::FlatList<GhostUpdates::Update> ghosts_;  ///< updates received from peers
  std::vector<LeavingObject>
      leaving_objects_;  ///< hosted objects that stand in another node's cell, by the map valid when they moved
  base::PairSort order_;
  OutputMergeScratch output_merge_scratch_;
  std::vector<std::uint64_t> stamps_;  ///< by node: see regions::for_each_owner
  std::uint64_t stamp_ = 0;
  bool map_is_new_ = false;                                 ///< received in this frame
  std::vector<std::uint32_t> new_map_;                      ///< entries of the new map received so far
  std::vector<std::vector<ObjectNumber>> leaving_numbers_;  ///< by next host

  messages::RunWriter states_run_, collisions_run_;
  messages::RunSender published_run_, change_run_, done_run_, kinds_run_, frame_done_run_, here_run_;
  std::vector<messages::RunSender> hand_over_runs_;
  messages::TrafficCounts traffic_{};
  messages::NodeFrameStats frame_stats_;
  std::uint64_t cpu_start_ = 0;
  std::uint64_t step_start_ = 0;
};

}  // namespace ringfence::nodes
