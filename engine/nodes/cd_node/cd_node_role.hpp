#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/cd_node_setup.hpp"
#include "nodes/cd_node/contact_publisher.hpp"
#include "nodes/cd_node/detector.hpp"
#include "nodes/cd_node/expected_messages.hpp"
#include "nodes/cd_node/halo_exchange.hpp"
#include "nodes/cd_node/migration.hpp"
#include "nodes/cd_node/mover.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/cd_node/peer_inbox.hpp"
#include "nodes/cd_node/queries/query_answerer.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "nodes/role.hpp"
#include "ringfence/fault.hpp"

namespace ringfence::nodes {

/// A collision detection node. It owns regions and tests the candidate pairs assigned to it, each once. In
/// user/collision deployment it also hosts the objects of its regions: it moves them and responds to their contacts.
///
/// This class is the state machine of a frame; advance() lists its steps, and each part does those that its name says.
/// A frame, in the order of its messages, or of the words that replace them within a process: frame_begin; move hosted
/// objects batch by batch, report them to the server (node_state), publish them for user nodes (published), and send
/// the other nodes what they need of them (ghost); receive the other objects of its region (M2) and the pairs to test,
/// or sweep for them, and test them as they arrive; send the contacts (M3); answer the queries of the frame, if there
/// are any; receive the contacts of hosted objects from the other nodes (M4); hand over objects that crossed a border
/// (M5); frame_done.
///
/// Threads: one thread at a time steps it. Never blocks, never throws; does not allocate in steady state.
class CdNodeRole {
 public:
  CdNodeRole(const CdNodeSetup& setup, const regions::RegionMap& map);

  Step step();

  /// Both set the node's slot and the other nodes, by slot: the connections to them with ExchangeKind::messages, what
  /// they share with ExchangeKind::shared. Between frames, while no thread steps the role.
  void assign(NodeNumber node, const std::vector<Connection>& peers);
  void assign(NodeNumber node, std::shared_ptr<const SharedNodes> nodes);

  CdNodeRole(const CdNodeRole&) = delete;
  CdNodeRole& operator=(const CdNodeRole&) = delete;

  /// Injects a fault; its node number is ignored. Between frames, while no thread steps the role; the last call counts.
  void fail(const Fault& fault) noexcept { state_.fault.set(fault); }

  /// The objects hosted after the last frame. Only while no frame is running.
  const Host& host() const noexcept { return state_.host; }
  /// Number of complete frames, and the statistics of the last one. Only while no frame is running.
  std::uint64_t frames() const noexcept { return frames_; }
  const messages::NodeFrameStats& last_frame() const noexcept { return state_.stats; }
  /// Whether the node is between frames, so that assign() may be called.
  bool is_between_frames() const noexcept { return state_.stage == CdNodeStage::waiting; }
  /// Whether the next step may need messages of other nodes. Those that arrive at other times can wait.
  bool awaits_peers() const noexcept;
  /// Number of messages from other processes that were discarded because they break the protocol. If it is not 0, such
  /// a process is faulty, and the frame may never end.
  std::uint64_t invalid_messages() const noexcept { return invalid_messages_; }

 private:
  Step step_once();
  bool follow(FrameControl::Announced announced);
  bool receive_from_server();
  bool receive_from_peers();
  PeerInbox::Verdict judge(const messages::MessageView& message) noexcept;
  void receive_from_peer(const messages::MessageView& message);
  void receive(const messages::MessageView& message);
  void end_frame(const messages::FrameEndRecord& end);
  void settle();
  void begin(std::uint64_t frame);
  void lose(const messages::LostRecord& record);
  void detect_again();
  bool answer_probe();
  bool advance();
  bool stops_here() noexcept;
  void detect();
  bool report_done();
  std::uint64_t cpu_spent() const noexcept;
  void end_wait() noexcept;

  NodeState state_;
  const std::unique_ptr<NodeExchange> exchange_;
  HaloExchange halo_;
  Migration migration_;
  Mover mover_;
  Detector detector_;
  ContactPublisher publisher_;
  QueryAnswerer answerer_;
  PeerInbox inbox_;
  ExpectedMessages expected_;
  messages::RunSender probe_reply_run_;
  bool awaits_map_ = false;  ///< a peer is lost, and the map under which the frame is detected again has not arrived
  std::uint64_t invalid_messages_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t cpu_start_ = 0;   ///< CPU time of the thread at the start of the frame, plus that of waits since, ns
  std::uint64_t wait_start_ = 0;  ///< cpu_spent() when the node had completed its last step
  std::uint64_t step_start_ = 0;  ///< ns
};

}  // namespace ringfence::nodes
