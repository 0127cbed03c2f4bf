#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "link/publication.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/frame_inputs.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/object.hpp"
#include "ringfence/status.hpp"

namespace ringfence::nodes {

/// A hosted object: S(k) without the model's state.
struct Hosted {
  messages::ObjectRef object;  ///< flags: flag_present, flag_host_owned
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};

/// Numbers of refused outputs of the model in the last move, by reason. The objects did not move.
struct HostRefusals {
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;
};

/// The objects that one role hosts, and their motion: S(k) from S(k-1) and C(k-1).
///
/// Used by user nodes, the server and CD nodes alike; an object's states do not depend on the role that hosts it.
/// Threads: belongs to its role. Memory: grows with the hosted objects and their contacts.
class Host {
 public:
  static constexpr std::size_t batch = 64;  ///< largest number of objects per call of the model

  /// `model` may be null (nothing moves by itself); if not, it outlives the host. `objects` is the number to reserve
  /// for. `fault` may be null; if not, it outlives the host, and the role can stop there before it calls the model.
  Host(const MotionModel* model, std::size_t objects, FaultPoint* fault = nullptr);

  std::size_t size() const noexcept { return hosted_.size(); }
  /// Whether the model reads contacts; if not, they are not sorted here.
  bool uses_contacts() const noexcept { return uses_contacts_; }
  const Hosted& operator[](std::size_t i) const noexcept { return hosted_[i]; }
  /// The model's state of hosted object i: state_bytes() bytes.
  const std::byte* state(std::size_t i) const noexcept { return states_.data() + i * state_bytes_; }
  /// The model's state_bytes() rounded up to 8, as in messages.
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// Index of a hosted object, or base::NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }

  /// The interest-grid cell in which the role publishes hosted object i, as last set by the role; `unplaced` after its
  /// adoption and after forget_cells().
  std::uint32_t cell(std::size_t i) const noexcept { return cells_[i]; }
  void set_cell(std::size_t i, std::uint32_t cell) noexcept { cells_[i] = cell; }
  void forget_cells() noexcept { std::fill(cells_.begin(), cells_.end(), unplaced); }
  static constexpr std::uint32_t unplaced = 0xfffffffeu;
  /// Cell of an object that is not published because it is absent.
  static constexpr std::uint32_t unpublished = link::Publication::no_cell;

  /// Position of hosted object i in a list of the role, as last set by the role; base::NumberIndex::none after its
  /// adoption.
  std::uint32_t place_in_list(std::size_t i) const noexcept { return places_in_list_[i]; }
  void set_place_in_list(std::size_t i, std::uint32_t place) noexcept { places_in_list_[i] = place; }

  /// ObjectSpec::group of hosted object i.
  std::uint32_t group(std::size_t i) const noexcept { return groups_[i]; }

  /// Takes over an object with its whole state, and replaces an object of the same number. `state` points to
  /// state_bytes() bytes. The protocol hands an object over once, and the server's message comes after that of any
  /// peer, so the last record is right.
  void adopt(const messages::HandOverRecord& record, const std::byte* state);
  /// Removes an object. The last object takes its index. Does nothing if the object is not hosted.
  void drop(ObjectNumber number);
  /// Sets or clears flag_host_owned of hosted object i. While it is set, the object's states are not sent to the
  /// server. place() and steer() clear it too.
  void set_host_owned(std::size_t i, bool host_owned) noexcept {
    std::uint32_t& flags = hosted_[i].object.flags;
    flags = (flags & ~messages::flag_host_owned) | (host_owned ? messages::flag_host_owned : 0u);
  }
  /// Sets whether the next move lists all hosted objects in changed().
  void list_all(bool all) noexcept { list_all_next_ = all; }
  /// Both prefetch an object that is handed over soon: first what find() reads, then the object. At the end of a frame
  /// neither is in the cache. So call prefetch_index() for all such objects, and only then prefetch_leaver() for all.
  void prefetch_index(ObjectNumber number) const noexcept { index_.prefetch(number); }
  void prefetch_leaver(ObjectNumber number) const noexcept;
  /// The record for the next host.
  messages::HandOverRecord hand_over(std::size_t i) const noexcept;
  /// Sets pose and presence. The next move continues from there. Returns false if the object is not hosted.
  bool place(ObjectNumber number, const Pose& pose, bool present);
  /// Adopts the objects of an `adopt` or `hand_over` message.
  void adopt(const messages::MessageView& message);
  /// Applies a message of type adopt, drop or place from the server. Returns false for any other type. Hand-overs come
  /// from CD nodes, and their receiver applies them with adopt().
  bool apply(const messages::MessageView& message);
  /// In the next move() the object takes `pose` and is present, whatever the model computes. Applies to one frame.
  void steer(ObjectNumber number, const Pose& pose);

  /// In the next move, and only in that, the model receives the input of the object, if it is hosted then.
  void give_input(const ObjectInput& input) { frame_inputs_.add(input); }

  /// Clears C(frame); the add functions below fill it. C(frame - 1) stays readable, also for other threads.
  void begin_contacts(std::uint64_t frame) noexcept { lists_[frame & 1].clear(); }
  /// Adds a contact of C(frame) that the role found itself, whether or not it hosts one of the two objects. In any
  /// order, but before any add_contact(). The caller writes all fields of the result except `phase`, which is set to
  /// persist. The reference is valid until the next contact is added.
  Contact& add_own_contact(std::uint64_t frame);
  /// Call it after the last own contact was added, once for each own contact in order of (a, b). `contact` is its
  /// position in the order of add_own_contact(), and `key` is base::PairSort::key of its two numbers. `a` and `b` are
  /// the indices at which the two objects are hosted, if known; they are tried first when contacts are gathered.
  void order_own_contact(std::uint64_t frame, std::uint64_t key, std::uint32_t contact,
                         std::uint32_t a = base::NumberIndex::none, std::uint32_t b = base::NumberIndex::none) {
    ContactList& list = lists_[frame & 1];
    list.keys.push_back(key);
    list.own_order.push_back({contact, a, b});
  }
  /// Sets the phase of an own contact to begin. `contact` is its position in the order of add_own_contact().
  void confirm_begin(std::uint64_t frame, std::uint32_t contact) noexcept {
    lists_[frame & 1].contacts[contact].phase = Phase::begin;
  }
  void prefetch_own_contact(std::uint64_t frame, std::uint32_t contact) const noexcept {
    base::prefetch_for_write(&lists_[frame & 1].contacts[contact].phase);
  }
  /// Adds the next contact of C(frame) that the role received, in order of (a, b). Ended contacts are stored for
  /// contacts(); the model does not get them.
  void add_contact(std::uint64_t frame, const Contact& contact) { lists_[frame & 1].add(contact); }
  /// Adds all contacts of a `notify` message.
  void add_contacts(std::uint64_t frame, const messages::MessageView& message);
  /// Adds a contact of C(frame - 1) before move(frame), for an object that was adopted between the two frames. Late
  /// contacts may come in any order and more than once.
  void add_late_contact(const Contact& contact) { late_.add(contact); }
  void add_late_contacts(const messages::MessageView& message);
  /// The next move reads C(frame - 1) in these lists instead of those that the other functions fill: all contacts in
  /// order of (a, b), parallel to their base::PairSort::key. They do not change until that move is done.
  void read_contacts(std::span<const Contact> contacts, std::span<const std::uint64_t> keys) noexcept {
    given_ = {contacts, keys, {}};
  }
  /// The contacts of C(frame) that the role received. They are overwritten two frames later.
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept {
    return lists_[frame & 1].contacts.span().subspan(lists_[frame & 1].own);
  }
  /// Reserves for this many contacts per frame.
  void reserve_contacts(std::size_t contacts);

  /// Computes S(frame) of all hosted objects from S(frame - 1) and C(frame - 1). Afterwards changed() lists the indices
  /// of the objects whose pose, presence or state differs. It also lists those with flag_host_owned, which are reported
  /// when they come to rest. Objects for which the model throws or returns an invalid pose do not move: see refusals().
  void move(std::uint64_t frame);
  /// The same in batches, so that changes are processed while they are in the cache. Call begin_move(), then
  /// move_next() until it returns false. After each call changed() lists the objects of that batch. Precondition: no
  /// steer() since the last move.
  void begin_move(std::uint64_t frame);
  bool move_next();
  std::span<const std::uint32_t> changed() const noexcept { return changed_.span(); }
  /// Parallel to changed(), one byte each: whether the object differs.
  std::span<const std::uint8_t> differs() const noexcept { return differs_.span(); }
  const HostRefusals& refusals() const noexcept { return refusals_; }

 private:
  /// A contact of a hosted object: its position in the list, and the indices of its objects. The index of an object
  /// that is not hosted, or not known to be, is base::NumberIndex::none.
  struct HostedContact {
    std::uint32_t contact, a, b;
  };
  /// Contacts of a frame: first `own` in the order of detection, then the received ones in order of (a, b).
  struct ContactList {
    base::FlatList<Contact> contacts;
    /// PairSort::key of each own contact, ascending; then that of each received contact, ascending, or 0 if it ended.
    base::FlatList<std::uint64_t> keys;
    /// Own contacts in order of (a, b), with the hosted indices known to the role.
    base::FlatList<HostedContact> own_order;
    std::size_t own = 0;

    void add(const Contact& contact);
    void clear() noexcept;
  };

  /// The contacts that a move reads.
  struct KnownContacts {
    std::span<const Contact> contacts;
    std::span<const std::uint64_t> keys;       ///< as in ContactList
    std::span<const HostedContact> own_order;  ///< as in ContactList
  };

  KnownContacts gather_contacts(std::uint64_t frame);
  void find_hosted(const KnownContacts& known);
  /// As find(), but tries the index `was` first.
  std::uint32_t find(ObjectNumber number, std::uint32_t was) const noexcept {
    return was < numbers_.size() && numbers_[was] == number ? was : index_.find(number);
  }
  /// Prefetches what that find() reads.
  void prefetch_number(ObjectNumber number, std::uint32_t was) const noexcept {
    if (was < numbers_.size()) {
      base::prefetch_for_read(&numbers_[was]);
    } else {
      index_.prefetch(number);
    }
  }
  void sort_contacts(const KnownContacts& known);
  void end_move() noexcept;
  void move_batches(std::size_t first, std::size_t end);
  void collect_changed(std::size_t first, std::size_t end);
  void move_batch(std::size_t first, std::size_t count);
  bool call_model(std::size_t first, std::size_t count);
  void prefetch(std::size_t i) const noexcept;
  std::span<const std::uint32_t> contacts_of(std::size_t i) const noexcept;
  void accept(std::size_t first, std::size_t count);
  bool accept(std::size_t i, const MotionOutput& output, const std::byte* next);

  const MotionModel* model_;
  FaultPoint* fault_;
  std::size_t state_bytes_;
  bool uses_contacts_;
  base::FlatList<Hosted> hosted_;
  base::FlatList<ObjectNumber> numbers_;  ///< of each hosted object; 16 fit a cache line
  base::FlatList<std::byte> states_;
  std::vector<std::uint8_t> touched_;  ///< by hosted object: it differs, or was placed since the last move
  bool list_all_next_ = false;
  bool list_all_ = false;  ///< list_all() applies to this move
  base::FlatList<std::uint32_t> cells_;
  base::FlatList<std::uint32_t> places_in_list_;
  base::FlatList<std::uint32_t> groups_;
  base::NumberIndex index_;
  ContactList lists_[2];  ///< by parity of the frame
  ContactList late_;
  KnownContacts given_;                       ///< see read_contacts(); empty: none
  const Contact* known_contacts_ = nullptr;   ///< C(k-1) while moving
  std::vector<std::uint32_t> contact_begin_;  ///< by hosted object: where its contacts begin in contact_order_
  base::FlatList<std::uint32_t> contact_order_;
  base::FlatList<HostedContact> hosted_contacts_;  ///< in order of (a, b)
  struct Steered {
    ObjectNumber number;
    Pose pose;
  };
  std::vector<Steered> steered_;
  FrameInputs frame_inputs_;
  base::FlatList<std::uint32_t> changed_;
  base::FlatList<std::uint8_t> differs_;
  std::uint64_t frame_ = 0;     ///< frame being moved
  std::size_t next_moved_ = 0;  ///< first object of the next move_next()
  HostRefusals refusals_;
  MotionInput inputs_[batch];
  MotionOutput outputs_[batch];
  std::vector<std::byte> scratch_;
};

/// Checks a pose, and normalises its orientation if its length differs from 1 by more than rounding. Returns ok,
/// not_finite (also for a position beyond farthest_coordinate), or not_unit (the length differs from 1 by more than
/// about 10^-3). Changes `pose` only if it returns ok. Idempotent: a second call accepts the pose and does not change
/// it. Any thread may call it.
Status make_valid(Pose& pose) noexcept;

}  // namespace ringfence::nodes
