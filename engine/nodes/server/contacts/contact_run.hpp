#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/server/objects/object_table.hpp"

namespace ringfence::nodes {

/// A contact that a node found and that is not in the list of contacts.
struct UnlistedContact {
  std::uint64_t key = 0;  ///< base::PairSort::key of the pair
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
};

/// The contacts that one node found in a frame, in order of (a, b), and which of them began or ended: received in
/// messages, or in memory that the node shares.
///
/// Use: begin(); then share(), or add() for each record and end(). Threads: as ContactLedger. Memory: grows to the
/// largest frame.
class ContactRun {
 public:
  /// Clears what was received.
  void begin(std::uint64_t frame);
  /// Adds a contact between the objects of its two slots in `objects`, whose rows and origins must not change before
  /// the next begin(). Returns false and adds nothing if (a, b) is below that of the contact before, if a slot is not
  /// in `objects`, or if a is not below b.
  bool add(const messages::CollisionRecord& record, const ContactObjects& objects);
  /// Adds the next change, after all contacts. Those that began come in the order of their positions, those that ended
  /// in the order of their keys, which must be in `keys_before`, the list of the frame before. Returns false and adds
  /// nothing if the record is out of order or names a contact that was not added, or that is not in that list.
  bool add(const messages::ChangeRecord& record, std::span<const std::uint64_t> keys_before);
  /// Everything has been added. `found_before` is parallel to `keys_before`.
  void end(const ContactObjects& objects, std::span<const Found> found_before);
  /// The contacts are those of a node that shares them.
  void share(NodeContacts& node_contacts) noexcept { shared_ = &node_contacts, is_complete_ = true; }

  /// The contacts at these positions, ascending, are not in the list of contacts.
  void unlist(std::span<const std::uint32_t> positions);
  /// The contact at this position was received as begun, and persists.
  void correct(std::uint32_t position) { corrections_.push_back(position); }
  /// The node takes part from that frame on.
  void join(std::uint64_t frame) noexcept { joined_ = frame; }

  /// Whether everything was received in this frame.
  bool is_complete() const noexcept { return is_complete_; }
  /// Whether that is so and the node took part in a frame before `frame` too.
  bool continues(std::uint64_t frame) const noexcept { return is_complete_ && joined_ < frame; }
  /// The contacts in memory that the node shares; null if they were received in messages.
  NodeContacts* shared() const noexcept { return shared_; }
  NodeContacts& node_contacts() const noexcept { return shared_ != nullptr ? *shared_ : *own_; }
  /// Number of contacts that were added.
  std::size_t received() const noexcept { return own_->keys.size(); }
  std::span<const std::uint32_t> corrections() const noexcept { return corrections_; }
  std::span<const UnlistedContact> unlisted() const noexcept { return unlisted_.span(); }

 private:
  bool add_ending(const messages::ChangeRecord& record, std::span<const std::uint64_t> keys_before);
  bool add_beginning(const messages::ChangeRecord& record);

  NodeContacts* shared_ = nullptr;
  std::unique_ptr<NodeContacts> own_ = std::make_unique<NodeContacts>();  ///< of a node that sends messages
  base::FlatList<narrow_phase::PairContact> touches_;                     ///< of `own_`, in its order
  std::vector<std::uint32_t> corrections_;
  base::FlatList<UnlistedContact> unlisted_;  ///< of `own_`
  /// Positions of the contacts that ended, in the frame before; parallel to `own_->ending`.
  base::FlatList<std::uint32_t> ended_at_;
  std::uint64_t joined_ = 0;  ///< the node's first frame
  bool is_complete_ = false;
};

}  // namespace ringfence::nodes
