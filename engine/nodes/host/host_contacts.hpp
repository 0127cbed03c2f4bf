#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "messages/header.hpp"
#include "nodes/host/hosted_objects.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// The contacts that a host's motion model reads: lists of C(k), and C(k-1) by hosted object.
///
/// The contacts of one frame come from two sources: those that the role found itself, in any order, and those that it
/// received. The next move reads both in order of (a, b).
///
/// Threads: belongs to its role. Memory: grows with the contacts of a frame.
class HostContacts {
 public:
  explicit HostContacts(std::size_t objects) { begins_.reserve(objects + 2); }

  /// From now on C(k) replaces C(k-1) when the move of frame k is done: for a role whose received() is not read. So
  /// the contacts occupy half the memory, and what a frame writes is what it has just read. Precondition: nothing was
  /// added.
  void keep_one_frame() noexcept { keeps_two_ = false; }
  /// Clears C(frame); the add functions below fill it, after the move of that frame. With two frames, C(frame - 1)
  /// stays readable, also for other threads.
  void begin(std::uint64_t frame) noexcept {
    if (keeps_two_ || moved_ == frame) {
      edition(frame).clear();
    }
  }
  /// Adds a contact of C(frame) that the role found itself, whether or not it hosts one of the two objects. In any
  /// order, but before any add(). The caller writes all fields of the result except `phase`, which is set to
  /// persist. The reference is valid until the next contact is added.
  Contact& add_own(std::uint64_t frame);
  /// Call it after the last own contact was added, once for each own contact in order of (a, b). `contact` is its
  /// position in the order of add_own(), and `key` is base::PairSort::key of its two numbers. `a` and `b` are
  /// the indices at which the two objects are hosted, if known; they are tried first when contacts are gathered.
  void order_own(std::uint64_t frame, std::uint64_t key, std::uint32_t contact,
                 std::uint32_t a = base::NumberIndex::none, std::uint32_t b = base::NumberIndex::none) {
    ContactList& own = edition(frame);
    own.keys.push_back(key);
    own.own_order.push_back({contact, a, b});
  }
  /// Sets the phase of an own contact to begin. `contact` is its position in the order of add_own().
  void confirm_begin(std::uint64_t frame, std::uint32_t contact) noexcept {
    edition(frame).contacts[contact].phase = Phase::begin;
  }
  /// The own contacts of C(frame) whose keys are not in `listed`, ascending, are not in the list of contacts: the model
  /// does not get them. All others are in it. Call it after the last order_own() and before any add().
  void unlist_own(std::uint64_t frame, std::span<const std::uint64_t> listed) noexcept {
    if (edition(frame).own_order.size() != listed.size()) [[unlikely]] {
      edition(frame).unlist(listed);
    }
  }
  void prefetch_own(std::uint64_t frame, std::uint32_t contact) const noexcept {
    base::prefetch_for_write(&edition(frame).contacts[contact].phase);
  }
  /// Adds the next contact of C(frame) that the role received, in order of (a, b). Ended contacts are stored for
  /// received(); the model does not get them.
  void add(std::uint64_t frame, const Contact& contact) { edition(frame).add(contact); }
  /// Adds all contacts of a `notify` message.
  void add(std::uint64_t frame, const messages::MessageView& message);
  /// Adds a contact of C(frame - 1) before move(frame), for an object that was adopted between the two frames. Late
  /// contacts may come in any order and more than once.
  void add_late(const Contact& contact) { late_.add(contact); }
  void add_late(const messages::MessageView& message);
  /// The next move reads C(frame - 1) in these lists instead of those that the other functions fill: all contacts in
  /// order of (a, b), parallel to their base::PairSort::key. They do not change until end_move().
  void read(std::span<const Contact> contacts, std::span<const std::uint64_t> keys) noexcept {
    given_ = {contacts, keys, {}};
  }
  /// The contacts of C(frame) that the role received. They are overwritten two frames later. Precondition: two frames
  /// are kept.
  std::span<const Contact> received(std::uint64_t frame) const noexcept {
    return edition(frame).contacts.span().subspan(edition(frame).own);
  }
  /// Reserves for this many contacts per frame.
  void reserve(std::size_t contacts);

  /// Sorts C(frame - 1) by hosted object, for a move. The indices of the objects do not change until end_move().
  void begin_move(std::uint64_t frame, const HostedObjects& objects);
  void end_move(std::uint64_t frame) noexcept {
    late_.clear();
    given_ = {};
    moved_ = frame;
    if (!keeps_two_) {
      edition(frame).clear();
    }
  }
  /// The list into which of() refers. From begin_move() on.
  const Contact* list() const noexcept { return list_; }
  /// The contacts of hosted object i in order of (a, b), as positions in list().
  std::span<const std::uint32_t> of(std::size_t i) const noexcept {
    return {order_.data() + begins_[i], begins_[i + 1] - begins_[i]};
  }

 private:
  /// A contact of a hosted object: its position in the list, and the indices of its objects. The index of an object
  /// that is not hosted, or not known to be, is base::NumberIndex::none.
  struct HostedContact {
    std::uint32_t contact, a, b;
  };
  /// Contacts of a frame: first `own` in the order of detection, then the received ones in order of (a, b).
  struct ContactList {
    base::FlatList<Contact> contacts;
    /// PairSort::key of each own contact that is listed, ascending; then that of each received contact, ascending, or 0
    /// if it ended.
    base::FlatList<std::uint64_t> keys;
    /// Own contacts that are listed, in order of (a, b), with the hosted indices known to the role.
    base::FlatList<HostedContact> own_order;
    std::size_t own = 0;

    void add(const Contact& contact);
    void unlist(std::span<const std::uint64_t> listed) noexcept;
    void clear() noexcept;
  };

  /// The contacts that a move reads.
  struct KnownContacts {
    std::span<const Contact> contacts;
    std::span<const std::uint64_t> keys;       ///< as in ContactList
    std::span<const HostedContact> own_order;  ///< as in ContactList
  };

  ContactList& edition(std::uint64_t frame) noexcept { return lists_[keeps_two_ ? frame & 1 : 0]; }
  const ContactList& edition(std::uint64_t frame) const noexcept { return lists_[keeps_two_ ? frame & 1 : 0]; }
  KnownContacts gather(std::uint64_t frame);
  void find_hosted(const KnownContacts& known, const HostedObjects& objects);

  ContactList lists_[2];  ///< by parity of the frame; only the first if one frame is kept
  bool keeps_two_ = true;
  std::uint64_t moved_ = ~std::uint64_t{0};  ///< frame of the last move that is done
  ContactList late_;
  KnownContacts given_;                ///< see read(); empty: none
  const Contact* list_ = nullptr;      ///< C(k-1) while moving
  std::vector<std::uint32_t> begins_;  ///< by hosted object: where its contacts begin in order_
  base::FlatList<std::uint32_t> order_;
  base::FlatList<HostedContact> hosted_;  ///< in order of (a, b)
};

}  // namespace ringfence::nodes
