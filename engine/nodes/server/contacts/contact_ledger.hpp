#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/output_merge.hpp"
#include "nodes/server/contacts/border_matches.hpp"
#include "nodes/server/contacts/contact_notices.hpp"
#include "nodes/server/contacts/contact_run.hpp"
#include "nodes/server/contacts/deepest_contacts.hpp"
#include "nodes/server/objects/object_table.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// The server's record of contacts: collects what the CD nodes found, resolves which contacts began, persist or ended,
/// and has the output lists written in order of (a, b).
///
/// Phases. Each node compares its own contacts with those that it found in the frame before (NodeContacts::compare). A
/// contact that began at one node and ended at another has moved between them and persists. Only contacts *at a border*
/// can do that: those for which the node cannot exclude it. So the ledger intersects the border contacts that began
/// with those that ended, and corrects the phases of the result. For a node of the frame before that takes no part in
/// this frame (it was lost or has left) all its contacts of the frame before end at a border.
///
/// Limit. With WorldConfig::deepest_contacts, the contacts that are not among the deepest of either of their objects
/// are removed before anything else (DeepestContacts), as if no node had found them.
///
/// Output. The nodes that share memory write the lists, a slice each; without such a node the ledger writes them. Two
/// frames are kept, by parity: the last one stays readable while the next is made. Where one thread steps all roles,
/// one frame is enough: as the last step of frame k that may fail, complete() writes C(k) over C(k-1).
///
/// Threads: belongs to the server role; the facade may call const functions for the last frame. Memory: grows to the
/// largest frame.
class ContactLedger {
 public:
  /// Reserves memory for `contacts` contacts a frame. More may be added, at the cost of an allocation.
  /// `deepest_contacts`: as in WorldConfig. `frames`: how many are kept, 1 or 2.
  ContactLedger(std::size_t nodes, std::size_t contacts, std::uint32_t deepest_contacts = 0, std::size_t frames = 2);

  /// Before the first frame, `frame`, of a world that is restored: `contacts` are those of the frame before, between
  /// live objects of the table, in order of (a, b). Completes what they state of the objects. In this frame they end at
  /// a border, like those of a node that is gone.
  void restore(std::uint64_t frame, std::span<Contact> contacts, const ObjectTable& objects);
  /// Sets the number of node slots from the next begin() on. A slot may have no node: then nothing is received from it.
  void resize(std::size_t nodes);
  /// A node takes the slot and takes part from that frame on: what another node found in this slot is not its own.
  void join(NodeNumber node, std::uint64_t frame) noexcept { runs_[node].join(frame); }
  /// Clears everything received, and C(frame) if two frames are kept.
  void begin(std::uint64_t frame);
  /// Adds a contact that `node` sent in a message, between the objects of its two slots in `objects`, whose rows and
  /// origins must not change before the next begin(): later calls read the poses there. A node sends its contacts in
  /// order of (a, b): returns false and adds nothing if (a, b) is below the pair that the node sent before, if a slot
  /// is not in `objects`, or if a is not below b.
  bool receive(NodeNumber node, const messages::CollisionRecord& record, const ContactObjects& objects);
  /// Adds the next change that `node` sent, after all its contacts. Those that began come in the order of their
  /// positions, those that ended in the order of their keys. Returns false and adds nothing if the record is out of
  /// order or names a contact that the node has not sent, or that was not in the frame before.
  bool receive(NodeNumber node, const messages::ChangeRecord& record);
  /// Adds all contacts and changes of a node with shared contacts.
  void receive(NodeNumber node, NodeContacts& node_contacts) noexcept {
    runs_[node].share(node_contacts);
    take(node, node_contacts);
  }
  /// All contacts and changes of a node that sends them have been received. `objects`: as for receive().
  void end_run(NodeNumber node, const ContactObjects& objects);
  std::size_t received(NodeNumber node) const noexcept {
    return runs_[node].shared() != nullptr ? summaries_[node].contacts : runs_[node].received();
  }
  /// Determines which contacts are listed, and which began and ended. All contacts must have been received. If two
  /// nodes found one pair, which only a bug can cause, its phase may be wrong in this frame and in the next.
  void resolve_phases();
  /// After resolve_phases(): opens the gates of the nodes that share contacts, which then write the output lists, and
  /// the gates for their hand-overs. If no node shares contacts, this call writes them. If one frame is kept, nothing
  /// is written before complete().
  void share_out();
  /// After share_out(), when a node is lost: writes its slice, unless the node has already started to write it.
  void lose(NodeNumber node);
  /// Call it when every node that is not lost is done, until it returns true: then C(frame) is complete. Returns false
  /// while a lost node is still writing. May throw std::bad_alloc; then the lists of the frame before can be read.
  bool complete();
  /// After share_out(), when all nodes are lost and the thread of one of them has stopped while it was writing: writes
  /// C(frame) again into other memory. Precondition: two frames are kept. The memory that such a thread may still
  /// access is kept until free_abandoned().
  void write_again();
  /// Precondition: the threads of all lost nodes have ended, and no frame is running.
  void free_abandoned() noexcept { abandoned_.clear(); }
  /// After complete(): number of duplicates, which were dropped. It is 0 unless a bug made two nodes own one pair.
  std::uint64_t duplicates() const noexcept { return duplicates_; }

  /// After resolve_phases(): the contacts that concern user nodes, or `all` contacts, in order of (a, b). Valid until
  /// complete(), and if two frames are kept until the nodes begin the next frame.
  std::span<const ContactNotice> notices(bool all);
  /// After resolve_phases(): the same for ended contacts, with the geometry of the last contact. Without
  /// `all`, contacts of nodes that are gone are listed whether or not they concern users.
  std::span<const ContactNotice> ended_notices(bool all);
  /// After resolve_phases(): positions of the contacts that `node` sent as begun and that persist; empty for a node
  /// that shares its contacts.
  std::span<const std::uint32_t> corrections(NodeNumber node) const noexcept { return runs_[node].corrections(); }
  /// After resolve_phases(): number of contacts that were found and are not listed.
  std::size_t unlisted() const noexcept { return unlisted_; }
  /// Those of them that `node` sent, in order of (a, b); empty for a node that shares its contacts.
  std::span<const UnlistedContact> unlisted(NodeNumber node) const noexcept { return runs_[node].unlisted(); }

  /// Begin and persist contacts of the current frame or of the one before, in order of (a, b); parallel to keys() and
  /// found(). For the current frame only after complete(). If one frame is kept, that of the frame before is gone then.
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept { return live_[parity(frame)].contacts.span(); }
  std::span<const std::uint64_t> keys(std::uint64_t frame) const noexcept { return live_[parity(frame)].keys.span(); }
  std::span<const Found> found(std::uint64_t frame) const noexcept { return live_[parity(frame)].found.span(); }
  /// Contacts that ended in the current frame or in the one before, in order of (a, b); parallel to ended_keys(). For
  /// the current frame only after complete().
  std::span<const Contact> ended(std::uint64_t frame) const noexcept { return ended_[frame & 1].contacts.span(); }
  std::span<const std::uint64_t> ended_keys(std::uint64_t frame) const noexcept {
    return ended_[frame & 1].keys.span();
  }
  /// After resolve_phases(): number of listed contacts, duplicates included.
  std::size_t size() const noexcept { return size_; }
  /// After resolve_phases(): number of ended contacts.
  std::size_t ends() const noexcept { return ends_; }
  /// After complete(): number of contacts that began.
  std::uint64_t began() const noexcept { return began_; }

 private:
  struct List {
    base::FlatList<Contact> contacts;
    base::FlatList<std::uint64_t> keys;
    base::FlatList<Found> found;

    void reserve(std::size_t size) {
      contacts.reserve_rarely_used(size), keys.reserve_rarely_used(size), found.reserve_rarely_used(size);
    }
    /// Makes room for `size` entries; those that are there stay.
    void grow(std::size_t size) { contacts.reserve(size), keys.reserve(size), found.reserve(size); }
    void resize(std::size_t size) { contacts.resize(size), keys.resize(size), found.resize(size); }
    void request_huge_pages() noexcept {
      contacts.request_huge_pages(), keys.request_huge_pages(), found.request_huge_pages();
    }
  };
  /// The memory that threads of lost nodes may still access after write_again().
  struct Abandoned {
    std::unique_ptr<OutputMerge> output_merge;
    std::vector<NodeContacts*> node_contacts;
    std::vector<std::span<const std::uint64_t>> endings;
    base::FlatList<std::uint64_t> absent;
    BorderMatches matches;
    std::vector<ContactRun> runs;
    List now, ended_now, before, ended_before;
  };

  std::size_t parity(std::uint64_t frame) const noexcept { return keeps_two_ ? frame & 1 : 0; }
  List& now() noexcept { return live_[parity(frame_)]; }
  List& ended() noexcept { return ended_[frame_ & 1]; }
  const List& before() const noexcept { return live_[parity(frame_ - 1)]; }
  /// All contacts of a node are known.
  void take(NodeNumber node, NodeContacts& node_contacts) noexcept {
    node_contacts_[node] = &node_contacts;
    summaries_[node] = node_contacts.summary;
    base::prefetch_for_read(summaries_[node].border_beginning.data());
    base::prefetch_for_read(summaries_[node].border_ending.data());
  }
  void unlist();
  void add_summaries();
  void end_absent();
  void match_borders();
  void start_output();
  void write_over();
  void drop_duplicates();

  std::vector<ContactRun> runs_;              ///< by node
  std::vector<NodeContacts*> node_contacts_;  ///< by node, from begin() on
  std::vector<ContactSummary> summaries_;     ///< of these; empty until all contacts of the node are known
  std::uint32_t deepest_contacts_;            ///< 0: no limit
  DeepestContacts deepest_;
  std::size_t unlisted_ = 0;
  BorderMatches matches_;
  /// Keys of the frame before whose nodes take no part in this frame, ascending.
  base::FlatList<std::uint64_t> absent_;
  std::vector<std::span<const std::uint64_t>> endings_;                          ///< OutputMerge::endings
  std::unique_ptr<OutputMerge> output_merge_ = std::make_unique<OutputMerge>();  ///< nodes hold its address
  OutputMergeScratch scratch_;
  std::vector<Abandoned> abandoned_;
  bool any_lost_ = false;            ///< in this frame, after share_out()
  bool written_again_ = false;       ///< in this frame
  std::ptrdiff_t participants_ = 0;  ///< number of nodes that took part in the last frame
  ContactNotices notices_;
  std::size_t size_ = 0;
  std::size_t ends_ = 0;
  std::uint64_t began_ = 0;
  std::uint64_t duplicates_ = 0;
  List live_[2];  ///< by parity of the frame; only the first if one frame is kept
  List ended_[2];
  bool keeps_two_;
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
