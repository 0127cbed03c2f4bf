#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/numbers.hpp"
#include "link/doorbell.hpp"
#include "link/gathering.hpp"
#include "nodes/exchange/sender_set.hpp"

namespace ringfence::nodes {

/// How many CD nodes of one process wake the server: a node notes that it has sent something, and of each 64 nodes only
/// the last one that ends a stage of the frame rings the server's doorbell. The server reads only the rings of the
/// nodes that have sent something. So a frame wakes it a few times, not three times for each node.
///
/// A node whose message does not end a stage, such as the answer to a probe, or that waits for room, wakes the server
/// at once. If a node of 64 does not end its stage, the server finds the messages of the others at its next deadline
/// check.
///
/// Threads: each function says whose it is. Memory: 7 KiB.
class Arrivals {
 public:
  /// The stages that end with a message to the server.
  enum class Stage : std::uint8_t { moved, tested, done };
  static constexpr std::size_t stages = 3, groups = SenderSet::capacity / 64;
  /// One bit a slot.
  using Members = std::array<std::uint64_t, groups>;

  /// The doorbell of the thread that steps the server; it outlives this object.
  explicit Arrivals(link::Doorbell& server) noexcept : server_(server) {}

  /// By the server, while the nodes wait: the nodes that take part in the next frame.
  void expect(const Members& members) noexcept {
    for (auto& stage : gatherings_) {
      for (std::size_t group = 0; group < groups; ++group) {
        stage[group].expect(members[group]);
      }
    }
  }
  /// By the server: calls visit(slot) for each node that has sent something since the last call.
  template <class Visit>
  void take(Visit visit) {
    senders_.take(visit);
  }

  /// By a node, after it has published messages, and before one of the next two.
  void note(NodeNumber slot) noexcept { senders_.add(slot); }
  /// By a node: it has ended a stage.
  void arrive(NodeNumber slot, Stage stage) noexcept {
    if (gatherings_[static_cast<std::size_t>(stage)][slot / 64].arrive(slot % 64)) {
      server_.ring();
    }
  }
  /// By a node: the server has to do something before the stage ends.
  void wake() noexcept { server_.ring(); }

 private:
  link::Doorbell& server_;
  SenderSet senders_;
  std::array<std::array<link::Gathering, groups>, stages> gatherings_;
};

}  // namespace ringfence::nodes
