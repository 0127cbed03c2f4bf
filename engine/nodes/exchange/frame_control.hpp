#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/numbers.hpp"
#include "link/atomics.hpp"
#include "link/doorbell.hpp"
#include "link/gathering.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/frame_mark.hpp"
#include "nodes/exchange/sender_set.hpp"

namespace ringfence::nodes {

/// What the server announces to all CD nodes of its process at once. All messages that belong to it have been sent.
enum class AnnouncedStep : std::uint8_t {
  none,
  frame_begin,     ///< move for the frame
  positions_sent,  ///< no `position_update` follows
  frame_end        ///< the contacts are final; those and the hand-overs of other nodes can be read
};

/// A step that a CD node has completed. All messages that belong to it have been sent.
enum class ReportedStep : std::uint8_t {
  none,
  moved,      ///< no `node_state` follows, and StepReport::next_hosts is valid
  published,  ///< the publication of what the node hosts can be read
  tested,     ///< StepReport::totals and kinds are valid, and the contacts can be read
  done        ///< the rest of StepReport is valid
};
inline constexpr std::size_t reported_steps = 4;

/// An object and the CD node that hosts it in the next frame.
struct NextHostOf {
  std::uint32_t slot = 0;
  NodeNumber next = 0;
  bool operator==(const NextHostOf&) const = default;
};

/// What a CD node reports to the server of its process. Both store and load `reached` as a whole: what it says is
/// valid was written before, and is not changed until the next frame begins, or this one is detected again.
struct alignas(link::cache_line_pair_bytes) StepReport {
  std::atomic<FrameMark<ReportedStep>> reached{};
  /// Objects of the node that are host-owned from this frame on, or leave, and of which it sent no `node_state`.
  std::span<const NextHostOf> next_hosts;
  messages::NarrowDoneRecord totals;
  /// By the server: the node follows no later announcement, because it is lost or has left. Also before the server has
  /// connected a fallback node.
  std::atomic<bool> dismissed{false};
  messages::NodeFrameStats stats;
  std::uint64_t ghosts = 0;      ///< number of ghost updates that the node gave to others
  std::uint64_t taken = 0;       ///< number of contacts that it read from others
  std::uint64_t duplicates = 0;  ///< contacts of its slice of the output whose pair was already written
  std::span<const messages::KindRecord> kinds;
};

/// How the server and the CD nodes of one process control a frame. One word of the server starts a step of all nodes,
/// and each node stores one word when it has completed a step. Between processes each of these is a message. Messages
/// remain for what has records, which most nodes do not have in most frames.
///
/// A node notes that it has sent messages, so the server reads only the rings of those. The last node that ends a step
/// wakes the server: a few times a frame, not several times for each node. If a node does not end its step, the server
/// finds what the others have reported at its next deadline check.
///
/// A word and the rings are ordered in both directions: who has loaded a word and then reads the ring finds all
/// messages that were published before the word was stored.
///
/// Threads: each function says whose it is. Memory: 8 KiB.
class FrameControl {
 public:
  using Announced = FrameMark<AnnouncedStep>;
  static constexpr std::size_t groups = SenderSet::capacity / 64;
  /// One bit a slot.
  using Members = std::array<std::uint64_t, groups>;

  /// The doorbell of the thread that steps the server; it outlives this object. Null: no thread sleeps. By the facade,
  /// while no role is stepped except lost nodes: these may read it, so the same value is not written again.
  void set_server_bell(link::Doorbell* bell) noexcept {
    if (server_bell_ != bell) {
      server_bell_ = bell;
    }
  }

  /// By the server, while the nodes wait: the nodes that take part in the next frame. After a loss a node may still set
  /// a bit of the frame before; bits are hints. `eager`: messages wake the server at once, also those that end no step.
  void expect(const Members& members, bool eager) noexcept {
    eager_.store(eager, std::memory_order_relaxed);
    std::uint64_t used = 0;
    for (std::size_t group = 0; group < groups; ++group) {
      used |= members[group] != 0 ? std::uint64_t{1} << group : 0;
    }
    for (Arrivals& step : arrivals_) {
      step.all.expect(used);
      for (std::size_t group = 0; group < groups; ++group) {
        step.by_group[group].expect(members[group]);
      }
    }
  }
  /// By the server, when a node is lost: in this frame each node wakes it, because that node may not arrive.
  void wake_for_each() noexcept {
    for (Arrivals& step : arrivals_) {
      step.all.wake_for_each();
      for (link::Gathering& group : step.by_group) {
        group.wake_for_each();
      }
    }
  }
  /// By the server. Returns false and does nothing if the same was announced last.
  bool announce(std::uint64_t frame, std::uint32_t epoch, AnnouncedStep step) noexcept {
    const Announced mark(frame, epoch, step);
    if (announced_.load(std::memory_order_relaxed) == mark) {
      return false;
    }
    frame_.store(frame, std::memory_order_relaxed);
    // Pairs with the load in announced().
    announced_.store(mark, std::memory_order_release);
    return true;
  }
  /// By the server: the nodes of a group of 64 slots that have completed a step in this frame, one bit each. A bit is a
  /// hint, since it may be that of a lost node: StepReport::reached says what the node has completed.
  std::uint64_t arrived(ReportedStep step, std::size_t group) const noexcept {
    return arrivals_[index_of(step)].by_group[group].arrived();
  }
  /// By the server: calls visit(slot) for each node that has sent messages since the last call.
  template <class Visit>
  void take_senders(Visit visit) {
    senders_.take(visit);
  }

  /// By a node: what the server has announced last. Call it before the ring is read.
  Announced announced() const noexcept { return announced_.load(std::memory_order_acquire); }
  /// By a node that takes part in it: number of the frame that was announced last.
  std::uint64_t frame() const noexcept { return frame_.load(std::memory_order_relaxed); }
  /// By a node, after it has published messages that end no step yet.
  void note_messages(NodeNumber slot) noexcept {
    senders_.add(slot);
    if (eager_.load(std::memory_order_relaxed)) {
      wake_server();
    }
  }
  /// By a node, after it has stored StepReport::reached.
  void arrive(NodeNumber slot, ReportedStep step) noexcept {
    Arrivals& arrivals = arrivals_[index_of(step)];
    const std::size_t group = slot / 64;
    if (arrivals.by_group[group].arrive(slot % 64) && arrivals.all.arrive(static_cast<unsigned>(group))) {
      wake_server();
    }
  }
  /// By a node: the server has to do something before the step ends.
  void wake_server() noexcept {
    if (server_bell_ != nullptr) {
      server_bell_->ring();
    }
  }

 private:
  /// Who has completed a step.
  struct Arrivals {
    std::array<link::Gathering, groups> by_group;  ///< of 64 nodes each
    link::Gathering all;                           ///< of the groups
  };

  static constexpr std::size_t index_of(ReportedStep step) noexcept { return static_cast<std::size_t>(step) - 1; }

  alignas(link::cache_line_pair_bytes) std::atomic<Announced> announced_{};
  std::atomic<std::uint64_t> frame_{0};
  std::atomic<bool> eager_{false};
  link::Doorbell* server_bell_ = nullptr;
  alignas(link::cache_line_pair_bytes) SenderSet senders_;
  std::array<Arrivals, reported_steps> arrivals_;
};

}  // namespace ringfence::nodes
