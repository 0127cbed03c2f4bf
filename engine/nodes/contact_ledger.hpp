#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "messages/records.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// The slots of a contact's two objects.
struct SlotPair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};

/// The server's account of contacts: takes what the CD nodes found, merges it in order of (a, b), and tells by the
/// frame before which contacts began, go on or ended.
///
/// Each node's run comes in order, so the merge compares and never sorts. Two frames are kept, by parity: the last one
/// stays readable while the next is made. Threads: belongs to the server role; const calls for the last frame from the
/// facade. Memory: grows to the largest frame.
class ContactLedger {
 public:
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// From the next begin() on there are so many nodes.
  void resize(std::size_t nodes) { received_.resize(nodes); }
  /// Empties C(frame) and what has been received.
  void begin(std::uint64_t frame);
  /// The next contact that `node` found.
  void receive(NodeNumber node, const messages::CollisionRecord& record) { received_[node].push_back(record); }
  std::size_t received(NodeNumber node) const noexcept { return received_[node].size(); }
  /// Merges what was received and gives the phases. Returns the pairs that two nodes found: always 0, unless a bug
  /// made two nodes own one pair; the surplus is dropped.
  std::uint64_t merge();

  /// Begin and persist contacts of the frame, in order of (a, b); parallel to slots().
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept { return editions_[frame & 1].contacts; }
  std::span<const SlotPair> slots(std::uint64_t frame) const noexcept { return editions_[frame & 1].slots; }
  /// Contacts that ended in the frame, in order of (a, b); parallel to ended_slots().
  std::span<const Contact> ended(std::uint64_t frame) const noexcept { return editions_[frame & 1].ended; }
  std::span<const SlotPair> ended_slots(std::uint64_t frame) const noexcept { return editions_[frame & 1].ended_slots; }
  std::uint64_t began() const noexcept { return began_; }

 private:
  struct Edition {
    std::vector<Contact> contacts;
    std::vector<SlotPair> slots;
    std::vector<Contact> ended;
    std::vector<SlotPair> ended_slots;
  };
  struct Run {
    const messages::CollisionRecord* next;
    const messages::CollisionRecord* end;
  };

  void accept(const messages::CollisionRecord& record, const Edition& before, std::size_t& old);
  void end_until(const Edition& before, std::size_t& old, std::uint64_t key);

  std::vector<std::vector<messages::CollisionRecord>> received_;  ///< by node
  std::vector<Run> heap_;
  Edition editions_[2];
  std::uint64_t frame_ = 0;
  std::uint64_t began_ = 0;
};

}  // namespace ringfence::nodes
