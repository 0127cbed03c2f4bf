#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/cd_node_setup.hpp"
#include "nodes/cd_node/node_region.hpp"
#include "nodes/cd_node/region_objects.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/host.hpp"

namespace ringfence::nodes {

/// The stages of a CD node's frame, in order; see CdNodeRole.
enum class CdNodeStage : std::uint8_t {
  waiting,
  moving,
  gathering,
  colliding,
  ending,
  handing_over,
  settling,
  reporting
};

/// Which runs of the server have arrived completely in this frame.
struct ReceivedRuns {
  bool positions = false;
  bool pairs = false;  ///< also true if the node sweeps its region itself
  bool frame_end = false;
};

/// The data that the parts of a CD node share. Each part changes it in its own steps of the frame; CdNodeRole changes
/// `stage`.
///
/// Threads: belongs to the CD node. Parts hold a reference, so it must not move.
struct NodeState {
  NodeState(const CdNodeSetup& initial, const regions::RegionMap& map);
  NodeState(const NodeState&) = delete;
  NodeState& operator=(const NodeState&) = delete;

  CdNodeSetup setup;
  messages::Endpoint self;
  NodeRegion region;
  FaultPoint fault;
  Host host;
  RegionObjects objects;      ///< those that overlap the region
  NodeContacts own_contacts;  ///< with ExchangeKind::messages
  NodeContacts& contacts;     ///< contacts and ghost updates of this node: own_contacts, or those that it shares
  CdNodeStage stage = CdNodeStage::waiting;
  ReceivedRuns received;
  std::uint64_t frame = 0;
  messages::TrafficCounts traffic{};
  messages::NodeFrameStats stats;

  /// Both set the node's slot and the other nodes, by slot: the connections to them, or what they share. Between
  /// frames.
  void assign(NodeNumber node, const std::vector<Connection>& peers);
  void assign(NodeNumber node, std::shared_ptr<const SharedNodes> nodes);
  /// Starts a frame: nothing has been received or found yet.
  void begin(std::uint64_t new_frame) noexcept;
  /// All that the detection reads arrives again: positions, and pairs if the server sends them.
  void await_positions() noexcept;
  /// Whether the node shares memory with the server and the other nodes; then words say when runs end (FrameControl).
  bool shares_memory() const noexcept { return setup.exchange == ExchangeKind::shared; }
  /// Whether objects are host-owned: their hosts, not the server, give the other nodes their positions.
  bool keeps_host_owned() const noexcept { return setup.hosts && setup.placement == Placement::region; }
  /// Whether the server needs the state of an object that comes to rest: if the node is lost, the server has the states
  /// that changed in its last two frames, and older ones only in its own table.
  bool reports_rest() const noexcept { return shares_memory() && setup.may_be_lost; }
  /// Whether the server needs no more of a host-owned object than its next host, which it reads in shared memory.
  bool lists_next_hosts() const noexcept { return keeps_host_owned() && shares_memory() && !setup.may_be_lost; }
  /// Whether the node's model reads the output lists of the frame before: those of the only node are its contacts. A
  /// node that may be lost does not, because its thread may still run when the lists are overwritten.
  bool reads_output() const noexcept {
    return setup.hosts && host.uses_contacts() && setup.exchange == ExchangeKind::shared && setup.slots() == 1 &&
           !setup.may_be_lost;
  }
  /// Whether the node keeps the contacts that it finds for its model.
  bool keeps_contacts() const noexcept { return setup.hosts && host.uses_contacts() && !reads_output(); }
  messages::RunHeader head(messages::MessageType type, messages::Endpoint to) const noexcept {
    return {type, self, to, frame, region.map().epoch()};
  }
  /// Sends a run of records to the server, see messages::RunSender::send(). True when it is sent, or not started.
  template <class RecordAt>
  bool send(messages::RunSender& run, messages::MessageType type, RecordAt record_at) {
    return run.send(*setup.server.out, head(type, messages::Endpoint::server()), traffic, record_at);
  }
  /// The same to another node; a run that is not started needs no connection.
  template <class RecordAt>
  bool send_to(NodeNumber peer, messages::RunSender& run, messages::MessageType type, RecordAt record_at) {
    return run.done() ||
           run.send(*setup.peers[peer].out, head(type, messages::Endpoint::node(peer)), traffic, record_at);
  }
  /// Sends a run without records to the server; true when it is sent.
  bool send_empty(messages::RunSender& run, messages::MessageType type) {
    return run.pump(*setup.server.out, head(type, messages::Endpoint::server()), 0, traffic,
                    [](std::size_t, std::byte*) {});
  }

 private:
  void settle(NodeNumber node);
};

}  // namespace ringfence::nodes
