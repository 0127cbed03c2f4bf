#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "nodes/flat_list.hpp"
#include "nodes/kept_states.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

class Host;

/// The slots of a contact's two objects, and the node that found it.
struct Found {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  NodeNumber by = 0;
};

/// A contact as the node that found it lists it.
struct FoundContact {
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
  std::uint32_t contact = 0;  ///< which of Findings::contacts
};

/// What a CD node found in a frame, in memory that it shares with the server where the two are in one process: in place
/// of the messages `collision` and `confirm`.
///
/// The server puts the keys of all nodes in order and answers with each contact's rank among all; then the node itself
/// copies its contacts to their places in the list that the embedder reads. So of a contact that concerns nobody but
/// its finder eight bytes pass through the server's hands, and all else is done by as many threads as there are nodes.
///
/// Threads: one writer at a time, handed over by messages. The node writes its part before `narrow_done` and leaves it
/// as it is until the next `frame_begin`; the server reads it from then on, and writes its own part before `frame_end`,
/// after which the node writes to the ledger. A node that is lost is told no more, so nothing of its part changes any
/// more but the phases of its contacts; the server writes to its part no more, and keeps what it may still write to.
struct Findings {
  // The node's part.
  const Host* host = nullptr;         ///< the node's; set once. Read between frames
  KeptStates kept;                    ///< states that it did not tell; its own rules hold
  const Contact* contacts = nullptr;  ///< as they were found
  FlatList<std::uint64_t> keys;       ///< ContactOrder::key, ascending
  FlatList<FoundContact> found;       ///< parallel to keys
  FlatList<std::uint32_t> outer;      ///< of these, ascending: all of which others may have to be told

  // The server's part.
  static constexpr std::uint32_t begins = 0x80000000u;   ///< in a rank: was not there in the frame before
  static constexpr std::uint32_t written = 0x40000000u;  ///< in a rank: the server has put it into the ledger
  static constexpr std::uint32_t rank_mask = written - 1;
  bool left = false;              ///< some are left to the node to write
  FlatList<std::uint32_t> ranks;  ///< parallel to keys: the place among all contacts of the frame
  Contact* live = nullptr;        ///< the ledger's contacts of the frame
  Found* ledger_found = nullptr;  ///< and who found them

  static Phase phase_of(std::uint32_t rank) noexcept { return (rank & begins) != 0 ? Phase::begin : Phase::persist; }
  /// Puts the i-th contact, which `node` found, to its place in lists like the ledger's.
  void write(std::size_t i, NodeNumber node, Contact* to_live, Found* to_found) const noexcept {
    const FoundContact& it = found[i];
    const Contact& from = contacts[it.contact];
    Contact& to = to_live[ranks[i] & rank_mask];
    to.a = from.a;
    to.b = from.b;
    to.phase = phase_of(ranks[i]);  // that of `from` its node may be writing
    std::memcpy(&to.depth, &from.depth, sizeof(Contact) - offsetof(Contact, depth));
    to_found[ranks[i] & rank_mask] = {it.slot_a, it.slot_b, node};
  }
  /// The node's last part in a frame: puts what the server has left to it into the ledger, and calls `begin` with each
  /// of its contacts that begins.
  template <class Begins>
  void write_rest(NodeNumber node, Begins begin) const {
    constexpr std::size_t ahead = 10;
    for (std::size_t i = 0; i < found.size(); ++i) {
      fetch(i + ahead);
      if ((ranks[i] & begins) != 0) {
        begin(found[i].contact);
      }
      if ((ranks[i] & written) == 0) {
        write(i, node, live, ledger_found);
      }
    }
  }
  /// Fetches what writing the i-th into the ledger will touch; `i` may be past the end. Contacts lie as they were
  /// found.
  void fetch(std::size_t i) const noexcept {
    if (i >= found.size()) {
      return;
    }
    const auto* from = reinterpret_cast<const std::byte*>(&contacts[found[i].contact]);
    __builtin_prefetch(from);
    __builtin_prefetch(from + 64);
    __builtin_prefetch(from + sizeof(Contact) - 1);
    const auto* to = reinterpret_cast<const std::byte*>(&live[ranks[i] & rank_mask]);
    __builtin_prefetch(to, 1);
    __builtin_prefetch(to + 64, 1);
    __builtin_prefetch(to + sizeof(Contact) - 1, 1);
  }
};

}  // namespace ringfence::nodes
