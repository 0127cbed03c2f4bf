#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "base/pair_sort.hpp"
#include "nodes/exchange/node_contact_order.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// The lists of a frame that the embedder reads, and what they are made of: all contacts, whoever found them, and those
/// that ended, each by (a, b). They are cut by key into as many stretches as there are nodes to write them.
///
/// Where a stretch begins in a list follows from how much of what each node found is below its first key, so whoever
/// writes one asks nobody. Threads: the server fills it before it admits the nodes to Findings::gate.
struct OutputMerge {
  std::span<NodeContacts* const> node_contacts;  ///< of all nodes, by number
  std::size_t shares = 1;                        ///< stretches
  Contact* contacts = nullptr;                   ///< parallel to keys and found: as many as all found together
  std::uint64_t* keys = nullptr;
  Found* found = nullptr;
  /// Keys of the frame before that their finders found no more: one or more lists, each ascending, each key once.
  std::span<const std::span<const std::uint64_t>> endings;
  std::span<const std::uint64_t> passed;  ///< those of them that another node found, ascending: they go on
  Contact* ended = nullptr;               ///< parallel to ended_keys: as many as the others
  std::uint64_t* ended_keys = nullptr;
  std::span<const std::uint64_t> keys_before;  ///< of all contacts of the frame before, ascending
  const Contact* contacts_before = nullptr;    ///< parallel to keys_before

  /// The key at which a stretch begins; of `shares`, one more than there are: above all keys. Any cut is right; those
  /// of the frame before are nearly even.
  std::uint64_t key_at(std::size_t share) const noexcept;
};

/// What writing a stretch takes, and other work on what was found; the writer's own.
struct OutputMergeScratch {
  NodeContactOrder order;
  base::PairSort ended_order;
  base::FlatList<std::size_t> ended;  ///< places in the frame before
  base::FlatList<std::uint32_t> begins;

  void reserve(std::size_t contacts);
};

/// Writes a stretch: contacts with phases, and those that ended as they were last. Returns how many of its contacts are
/// of a pair that has been written before it: always 0, unless a bug made two nodes own one pair. They are written too,
/// so that every stretch has the place that its neighbours reckon with.
///
/// Any thread that may read all findings of the frame: see Findings::gate.
std::uint64_t write_slice(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch);

}  // namespace ringfence::nodes
