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

/// The output lists of a frame, which the embedder reads, and their sources: the contacts of all nodes, and the ended
/// ones, each by (a, b). They are divided by key into as many slices as there are nodes to write them.
///
/// The position of a slice in a list follows from the number of each node's keys below the first key of the slice, so
/// slices can be written independently. Threads: the server fills it before it opens NodeContacts::gate.
struct OutputMerge {
  std::span<NodeContacts* const> node_contacts;  ///< by node number
  std::size_t shares = 1;                        ///< number of slices
  bool server_writes = false;                    ///< no node writes a slice: the server writes the lists at the end
  std::size_t size = 0;                          ///< number of contacts that all nodes found together
  Contact* contacts = nullptr;                   ///< parallel to keys and found
  std::uint64_t* keys = nullptr;
  Found* found = nullptr;
  /// Keys of the frame before that their nodes did not find again: one or more lists, each ascending, each key once.
  std::span<const std::span<const std::uint64_t>> endings;
  std::span<const std::uint64_t> passed;  ///< those of them that another node found, ascending: they persist
  Contact* ended = nullptr;               ///< parallel to ended_keys; as many as ended
  std::uint64_t* ended_keys = nullptr;
  std::span<const std::uint64_t> keys_before;  ///< of all contacts of the frame before, ascending
  const Contact* contacts_before = nullptr;    ///< parallel to keys_before

  /// First key of a slice; for `shares`, a key above all. Any division is correct; the keys of the frame before make it
  /// nearly even.
  std::uint64_t key_at(std::size_t share) const noexcept;
};

/// Working memory of write_slice(); belongs to the writer.
struct OutputMergeScratch {
  NodeContactOrder order;     ///< of the contacts that are not ended; not used for one node, whose list is in order
  std::size_t listed_at = 0;  ///< position of the first of them in the output lists
  base::PairSort ended_order;
  base::FlatList<std::size_t> ended;  ///< positions in the frame before

  void reserve(std::size_t contacts);
};

/// The parts of write_slice(), in this order: write the ended contacts; sort all others; write them. The last part
/// allocates nothing, and may write over the lists of the frame before if there is one slice.
void write_ended(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch);
void sort_listed(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch);
std::uint64_t write_listed(const OutputMerge& output_merge, const OutputMergeScratch& scratch) noexcept;

/// Writes one slice: contacts with their phases, and ended contacts as they last were. Returns the number of contacts
/// whose pair was already written: 0 unless a bug made two nodes own one pair. Duplicates are written too, so that
/// every slice starts where the others expect it.
///
/// Called by any thread that may read the contacts of all nodes; see NodeContacts::gate.
std::uint64_t write_slice(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch);

}  // namespace ringfence::nodes
