#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/number_index.hpp"
#include "base/prefetch.hpp"
#include "link/publication.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/object.hpp"
#include "ringfence/status.hpp"

namespace ringfence::nodes {

/// An object in the hands of its host: S(k), without the model's part.
struct Hosted {
  messages::ObjectRef object;  ///< flags: flag_present, flag_host_owned
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};

/// Counts of model outputs that were refused; the objects stood still.
struct HostRefusals {
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;
};

/// The objects that one role hosts, and how they move: S(k) from S(k-1) and C(k-1).
///
/// The same for user nodes, the server and CD nodes: which of them hosts an object cannot be seen in its states.
/// Threads: belongs to its role. Memory: grows with the objects and contacts hosted.
class Host {
 public:
  static constexpr std::size_t batch = 64;  ///< objects that are moved at a time, at most

  /// `model` may be null (nothing moves by itself) and outlives the host. `objects` are reserved.
  Host(const MotionModel* model, std::size_t objects);

  std::size_t size() const noexcept { return hosted_.size(); }
  /// Whether the model looks at contacts; else they need not be put in order here.
  bool uses_contacts() const noexcept { return uses_contacts_; }
  const Hosted& operator[](std::size_t i) const noexcept { return hosted_[i]; }
  /// The model's part of the state of hosted object i; state_bytes() long.
  const std::byte* state(std::size_t i) const noexcept { return states_.data() + i * state_bytes_; }
  /// The model's state_bytes() rounded up to 8: what messages carry.
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// Index of a hosted object, or base::NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }

  /// The cell of the interest grid in which the role publishes hosted object i: what the role last said, unplaced from
  /// its adoption or the last forget_cells() on.
  std::uint32_t cell(std::size_t i) const noexcept { return cells_[i]; }
  void set_cell(std::size_t i, std::uint32_t cell) noexcept { cells_[i] = cell; }
  void forget_cells() noexcept { std::fill(cells_.begin(), cells_.end(), unplaced); }
  static constexpr std::uint32_t unplaced = 0xfffffffeu;
  /// Nobody is told where it is: it is not present.
  static constexpr std::uint32_t unpublished = link::Publication::no_cell;

  /// What the role last noted of hosted object i: where it is in a list of the role's. base::NumberIndex::none from its
  /// adoption on.
  std::uint32_t place_in_list(std::size_t i) const noexcept { return places_in_list_[i]; }
  void set_place_in_list(std::size_t i, std::uint32_t place) noexcept { places_in_list_[i] = place; }

  /// Takes over an object with its whole state; what it had of one of that number is forgotten. The protocol gives an
  /// object once, and the server's word, which orders a frame, comes after any peer's: so what comes last holds.
  void adopt(const messages::HandOverRecord& record, const std::byte* state);
  /// Forgets an object. The last one takes its index. Does nothing if it is not hosted.
  void drop(ObjectNumber number);
  /// Sets or takes off flag_host_owned of hosted object i: its host keeps its states to itself. place() takes it off,
  /// too.
  void keep(std::size_t i, bool kept) noexcept {
    std::uint32_t& flags = hosted_[i].object.flags;
    flags = (flags & ~messages::flag_host_owned) | (kept ? messages::flag_host_owned : 0u);
  }
  /// Whether the next move lists all that is hosted as changed().
  void list_all(bool all) noexcept { list_all_next_ = all; }
  /// Fetches where find() looks for an object that is soon handed over, then what is handed over and dropped of it:
  /// each for all of them before the next, since what has left is not in the cache by the end of a frame.
  void prefetch_index(ObjectNumber number) const noexcept { index_.prefetch(number); }
  void prefetch_leaver(ObjectNumber number) const noexcept;
  /// What the next host must be given.
  messages::HandOverRecord hand_over(std::size_t i) const noexcept;
  /// Sets the pose from outside before the next move; the model goes on from there. False if it is not hosted.
  bool place(ObjectNumber number, const Pose& pose, bool present);
  /// Takes over what a message of type adopt or hand_over says.
  void adopt(const messages::MessageView& message);
  /// Does what a message of type adopt, drop or place says; false for any other. The server's word: a hand-over, which
  /// is another CD node's, is for whoever listens to such.
  bool apply(const messages::MessageView& message);
  /// In the next move the object stands at `pose`, whatever the model says. Counts for one frame.
  void steer(ObjectNumber number, const Pose& pose);

  /// Empties C(frame), of which the contacts then follow. C(frame - 1) stays readable, also for other threads.
  void begin_contacts(std::uint64_t frame) noexcept { lists_[frame & 1].clear(); }
  /// Adds a contact of C(frame) that the role found itself, in any order, whether or not it hosts either object. Before
  /// any add_contact. Returns where it is to be written, all of it but the phase, which reads persist.
  Contact& add_own_contact(std::uint64_t frame);
  /// After the last of them: which of the own contacts, counted as they were added, is the next in order of (a, b);
  /// `key` is base::PairSort::key of its two numbers. `a`, `b`: where the two are hosted, if the role knows: that is
  /// looked at first when their contacts are gathered.
  void order_own_contact(std::uint64_t frame, std::uint64_t key, std::uint32_t contact,
                         std::uint32_t a = base::NumberIndex::none, std::uint32_t b = base::NumberIndex::none) {
    ContactList& list = lists_[frame & 1];
    list.keys.push_back(key);
    list.own_order.push_back({contact, a, b});
  }
  /// Says which of the own contacts persist: bit i of `persists` that of the own contact 64 * word + i by (a, b).
  void confirm(std::uint64_t frame, std::size_t word, std::uint64_t persists) noexcept;
  /// Says that an own contact, counted as they were added, begins.
  void confirm_begin(std::uint64_t frame, std::uint32_t contact) noexcept {
    lists_[frame & 1].contacts[contact].phase = Phase::begin;
  }
  void prefetch_own_contact(std::uint64_t frame, std::uint32_t contact) const noexcept {
    base::prefetch_for_write(&lists_[frame & 1].contacts[contact].phase);
  }
  /// Adds the next contact of C(frame) that the role was told, in order of (a, b). Ended ones are kept for whoever
  /// asks, not for the model.
  void add_contact(std::uint64_t frame, const Contact& contact) { lists_[frame & 1].add(contact); }
  /// The same of all that a message of type notify tells.
  void add_contacts(std::uint64_t frame, const messages::MessageView& message);
  /// Adds a contact of C(frame - 1) before move(frame): what a new host is told of an object that it took over between
  /// two frames. In any order, and possibly known already.
  void add_late_contact(const Contact& contact) { late_.add(contact); }
  void add_late_contacts(const messages::MessageView& message);
  /// What was told for that frame or, with the same parity, the one two before.
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept {
    return lists_[frame & 1].contacts.span().subspan(lists_[frame & 1].own);
  }
  /// Reserves for so many contacts a frame.
  void reserve_contacts(std::size_t contacts);

  /// S(frame) of all hosted objects from S(frame - 1) and C(frame - 1). Afterwards changed() lists those whose pose,
  /// presence or state differ, and those with flag_host_owned, which is how they come to be told when they rest.
  void move(std::uint64_t frame);
  /// The same a batch at a time, so that what changed can be told while it is still in the cache: begin_move(), then
  /// move_next() until it answers false; changed() then lists those of the last batch. Precondition: nothing steered.
  void begin_move(std::uint64_t frame);
  bool move_next();
  std::span<const std::uint32_t> changed() const noexcept { return changed_.span(); }
  /// Parallel to it, one byte each: whether it differs.
  std::span<const std::uint8_t> differs() const noexcept { return differs_.span(); }
  const HostRefusals& refusals() const noexcept { return refusals_; }

 private:
  /// A contact of an object that is hosted: its place in the list, and who of the two is hosted.
  struct HostedContact {
    std::uint32_t contact, a, b;
  };
  /// Contacts of a frame: first `own` as they were found, then what was told, in order of (a, b).
  struct ContactList {
    base::FlatList<Contact> contacts;
    base::FlatList<std::uint64_t>
        keys;  ///< base::PairSort::key, ascending: of the own ones, then of the told; 0 if it ended
    base::FlatList<HostedContact> own_order;  ///< the own ones by (a, b), hosted as the role knew
    std::size_t own = 0;

    void add(const Contact& contact);
    void clear() noexcept;
  };

  const ContactList& gather_contacts(std::uint64_t frame);
  void find_hosted(const ContactList& list);
  /// As find(), for who remembers where it was.
  std::uint32_t find(ObjectNumber number, std::uint32_t was) const noexcept {
    return was < numbers_.size() && numbers_[was] == number ? was : index_.find(number);
  }
  /// Fetches what that looks at.
  void prefetch_number(ObjectNumber number, std::uint32_t was) const noexcept {
    if (was < numbers_.size()) {
      base::prefetch_for_read(&numbers_[was]);
    } else {
      index_.prefetch(number);
    }
  }
  void sort_contacts(const ContactList& list);
  void move_batches(std::size_t first, std::size_t end);
  void collect_changed(std::size_t first, std::size_t end);
  void move_batch(std::size_t first, std::size_t count);
  bool call_model(std::size_t first, std::size_t count);
  void prefetch(std::size_t i) const noexcept;
  std::span<const std::uint32_t> contacts_of(std::size_t i) const noexcept;
  void accept(std::size_t first, std::size_t count);
  bool accept(std::size_t i, const MotionOutput& output, const std::byte* next);

  const MotionModel* model_;
  std::size_t state_bytes_;
  bool uses_contacts_;
  base::FlatList<Hosted> hosted_;
  base::FlatList<ObjectNumber> numbers_;  ///< of each, sixteen a line of the cache
  base::FlatList<std::byte> states_;
  std::vector<std::uint8_t> touched_;  ///< differs, or was placed since the last move
  bool list_all_next_ = false;
  bool list_all_ = false;  ///< in this move
  base::FlatList<std::uint32_t> cells_;
  base::FlatList<std::uint32_t> places_in_list_;
  base::NumberIndex index_;
  ContactList lists_[2];  ///< by parity of the frame
  ContactList late_;
  const Contact* known_contacts_ = nullptr;   ///< C(k-1) while moving
  std::vector<std::uint32_t> contact_begin_;  ///< by hosted object: its run in contact_order_
  base::FlatList<std::uint32_t> contact_order_;
  base::FlatList<HostedContact> hosted_contacts_;  ///< in order of (a, b)
  struct Steered {
    ObjectNumber number;
    Pose pose;
  };
  std::vector<Steered> steered_;
  base::FlatList<std::uint32_t> changed_;
  base::FlatList<std::uint8_t> differs_;
  std::uint64_t frame_ = 0;     ///< that is being moved
  std::size_t next_moved_ = 0;  ///< of move_next()
  HostRefusals refusals_;
  MotionInput inputs_[batch];
  MotionOutput outputs_[batch];
  std::vector<std::byte> scratch_;
};

/// Whether a pose may stand in the world, and its orientation made unit where it is not already within rounding.
/// Returns ok, not_finite or not_unit; `pose` changes only with ok. Idempotent: what it returned it accepts unchanged.
Status make_valid(Pose& pose) noexcept;

}  // namespace ringfence::nodes
