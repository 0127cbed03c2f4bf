#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/prefetch.hpp"
#include "base/system_vector.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// The server's state for one connected role: its connection, what is to be sent to it, and what was received from it.
///
/// What each frame reads and writes for a CD node is in the first four cache lines. The rest is for messages that few
/// nodes get in a frame: a thousand sessions are as large as a second-level cache.
struct alignas(64) PeerSession {
  /// Sent before a frame, before `frame_begin`: changes of what it hosts. Only if PeerSession::changes.
  struct Opening {
    std::vector<std::uint32_t> drops, placements;   ///< objects by slot
    base::SystemVector<std::uint32_t> adoptions;    ///< the same
    std::vector<Contact> contacts;                  ///< of the frame before, for adopted objects
    std::vector<messages::RefusedRecord> refusals;  ///< its refused records of the frame before
    messages::RunSender query_run;                  ///< CD nodes; see FrameOrder::queries
    std::vector<std::uint32_t> sensed;              ///< CD nodes; rows of Publications::sensed
    messages::RunSender sensed_run;
    messages::RunSender drop_run, adopt_run, place_run, contact_run, refused_run;
  };

  /// Sent after the narrow phase, before `frame_end`.
  struct Closing {
    /// Positions in ContactLedger::notices(), or with the bit `ended` in ended_notices().
    std::vector<std::uint32_t> notices;
    static constexpr std::uint32_t ended = 0x80000000u;
    messages::RunSender ghosts_run;  ///< earlier: before its positions
    messages::RunSender map_run, unlist_run, correct_run, notice_run;
  };

  /// Sent at once when another node is lost.
  struct Loss {
    std::vector<messages::LostRecord> records;
    messages::RunSender lost_run, map_run;
  };

  /// Received in `frame`. Of a user node the fields may be those of an earlier frame: see ServerState::received_from().
  struct Received {
    static constexpr std::size_t max_refusals = 64;  ///< listed per frame; all are counted
    std::uint64_t frame = ~std::uint64_t{0};
    std::size_t bytes = 0;
    std::size_t updates = 0;
    bool states = false;  ///< the last message with states; so for the other messages
    bool published = false;
    bool narrow_done = false;
    bool frame_done = false;
    std::vector<messages::RefusedRecord> refusals;

    /// For a new frame; keeps the refusals.
    void begin(std::uint64_t new_frame) noexcept {
      frame = new_frame;
      bytes = updates = 0;
      states = published = narrow_done = frame_done = false;
    }
  };

  /// When a step of the frame was done for this node, for PathReport.
  struct Reached {
    std::uint64_t ns = 0;  ///< 0: not yet, or not noted
    double ms = 0;         ///< CPU time of the server's step until then
  };

  messages::Endpoint self;
  NodeNumber id = 0;  ///< CD nodes: never used by another node, unlike the slot in `self`
  Connection connection;
  bool connected = false;             ///< false: nothing else is valid; of a CD node: the slot is free
  bool lost = false;                  ///< lost in this frame: nothing more is sent to it or accepted from it
  bool broken = false;                ///< in another process, and has broken the protocol: lost at the end of this step
  bool leaving = false;               ///< must hand everything over at the end of this frame
  bool left = false;                  ///< hands everything over in this frame; its slot is free at the next cut
  bool changes = false;               ///< `opening` has something to send; users: listed in UserConnection::changed
  std::uint32_t user_connection = 0;  ///< users: position in ServerState::user_connections
  std::size_t in_report = 0;          ///< CD nodes: position in FrameReport::nodes of this frame

  Received received;
  std::uint64_t last_received_ns = 0;  ///< time of the last message from it

  messages::RunSender begin_run, end_run;  ///< CD nodes: `frame_begin` and `frame_end`
  std::uint64_t hand_overs = 0;            ///< CD nodes: number of hand-overs that it will receive in this frame
  double cost_ms = no_cost;                ///< CD nodes: cost of the last complete frame, for balance
  static constexpr double no_cost = -1;

  Reached started;              ///< all messages that start its frame were sent
  Reached dispatched;           ///< CD nodes: all positions were sent
  Reached notified;             ///< its contacts were sent
  std::uint64_t probed_ns = 0;  ///< time of the last probe; 0: a message has arrived since

  Opening opening;
  Closing closing;
  Loss loss;
  messages::RunSender probe_run;

  bool is_active() const noexcept { return connected && !lost; }
  /// Prefetches what each frame reads and writes for a CD node.
  void prefetch_frame() const noexcept {
    for (const std::byte* line = reinterpret_cast<const std::byte*>(this);
         line < reinterpret_cast<const std::byte*>(&opening); line += 64) {
      base::prefetch_for_write(line);
    }
  }
};

}  // namespace ringfence::nodes
