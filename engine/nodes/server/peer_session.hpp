#pragma once

#include <cstdint>
#include <vector>

#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// What the server has for one of the roles that it talks to: the line, what is to be sent, and what has been heard.
struct PeerSession {
  messages::Endpoint self;
  Connection connection;
  bool connected = false;
  bool lost = false;     ///< has stopped answering in this frame: nothing more is sent to it or believed of it
  bool leaving = false;  ///< is to hand everything over at the end of a frame
  bool left = false;     ///< has done so: gone at the next cut

  // To be sent before a frame: objects by slot, contacts by index in the frame before.
  std::vector<std::uint32_t> drops, adoptions, placements;
  std::vector<Contact> late_contacts;
  std::vector<messages::RefusedRecord> refusals;  ///< what of its messages was refused in the frame before
  // To be sent after the narrow phase: places in ContactLedger::told(), with the bit `ended` in ended_notices().
  std::vector<std::uint32_t> notices;
  std::uint64_t hand_overs = 0;  ///< that will reach it (CD nodes)
  static constexpr std::uint32_t ended = 0x80000000u;

  messages::RunSender drop_run, adopt_run, place_run, late_run, refused_run, begin_run;
  messages::RunSender read_publications_run;  ///< to be sent once all is published
  messages::RunSender map_run, confirm_run, notice_run, end_run;
  messages::RunSender lost_run, new_map_run, probe_run;
  std::vector<messages::LostRecord> losses;  ///< to be told to it at once

  std::uint64_t last_received_ns = 0;  ///< when something last came from it
  std::uint64_t probed_ns = 0;         ///< when it was last asked whether it is there; 0: not since something came

  std::uint64_t started_ns = 0;   ///< when all was sent to it that the frame begins with; 0: not yet
  std::uint64_t notified_ns = 0;  ///< likewise, that contacts are known
  double started_ms = 0;          ///< what PathReport::start_nodes_ms was by then
  double notified_ms = 0;         ///< and PathReport::notify_ms

  // Heard in this frame.
  std::size_t received_bytes = 0;
  std::size_t received_updates = 0;
  bool states_received = false;
  bool published_received = false;
  bool narrow_done_received = false;
  bool frame_done_received = false;
  static constexpr std::size_t max_refusals = 64;  ///< reported a frame; all are counted
  std::vector<messages::RefusedRecord> new_refusals;
};

}  // namespace ringfence::nodes
