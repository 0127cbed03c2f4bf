#pragma once

#include <cstdint>
#include <vector>

#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// The server's state for one connected role: its connection, what is to be sent to it, and what was received from it.
struct PeerSession {
  messages::Endpoint self;
  NodeNumber id = 0;  ///< CD nodes: never used by another node, unlike the slot in `self`
  Connection connection;
  bool connected = false;  ///< false: nothing else is valid; of a CD node: the slot is free
  bool lost = false;       ///< lost in this frame: nothing more is sent to it or accepted from it
  bool broken = false;     ///< in another process, and has broken the protocol: lost at the end of this step
  bool leaving = false;    ///< must hand everything over at the end of this frame
  bool left = false;       ///< hands everything over in this frame; its slot is free at the next cut

  // To be sent before a frame: objects by slot, contacts of the frame before.
  std::vector<std::uint32_t> drops, adoptions, placements;
  std::vector<Contact> late_contacts;
  std::vector<messages::RefusedRecord> refusals;  ///< its refused records of the frame before
  // To be sent after the narrow phase: positions in ContactLedger::notices(), or with the bit `ended` in
  // ended_notices().
  std::vector<std::uint32_t> notices;
  std::uint64_t hand_overs = 0;  ///< number of hand-overs it will receive (CD nodes)
  static constexpr std::uint32_t ended = 0x80000000u;

  messages::RunSender drop_run, adopt_run, place_run, late_run, refused_run, begin_run;
  messages::RunSender read_publications_run;  ///< to be sent when everything is published
  messages::RunSender map_run, correct_run, notice_run, end_run;
  messages::RunSender lost_run, new_map_run, probe_run;
  std::vector<messages::LostRecord> losses;  ///< to be sent at once

  std::uint64_t last_received_ns = 0;  ///< time of the last message from it
  std::uint64_t probed_ns = 0;         ///< time of the last probe; 0: a message has arrived since

  std::uint64_t started_ns = 0;   ///< time when all messages that start its frame were sent; 0: not yet
  std::uint64_t notified_ns = 0;  ///< time when its contacts were sent; 0: not yet
  double started_ms = 0;          ///< PathReport::start_nodes_ms at that time
  double notified_ms = 0;         ///< PathReport::notify_ms at that time

  std::size_t in_report = 0;  ///< CD nodes: position in FrameReport::nodes of this frame
  double cost_ms = no_cost;   ///< CD nodes: cost of the last complete frame, for balance
  static constexpr double no_cost = -1;

  // Received in this frame.
  std::size_t received_bytes = 0;
  std::size_t received_updates = 0;
  bool states_received = false;
  bool published_received = false;
  bool narrow_done_received = false;
  bool frame_done_received = false;
  static constexpr std::size_t max_refusals = 64;  ///< reported per frame; all are counted
  std::vector<messages::RefusedRecord> new_refusals;
};

}  // namespace ringfence::nodes
