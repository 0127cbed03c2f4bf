#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/pair_sort.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

/// Finds the hits of a CD node: the candidate pairs that it owns and whose shapes are in contact. The pairs come from
/// the server, or from a sweep of the node's RegionObjects.
///
/// Pairs are tested in batches that are large enough for full blocks of every pair of kinds, and small enough that the
/// objects of a batch stay in the cache from the sort to the kernels.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class Detector {
 public:
  explicit Detector(NodeState& state);

  /// Discards pairs and hits, at the start of a frame and before it is detected again.
  void discard();
  /// Adds the pairs of a `pairs` message and tests the full batches.
  void receive_pairs(const messages::MessageView& message);
  /// When all positions and pairs have arrived: sweeps, if the node does, and tests all that is left.
  void test_all();
  /// Then: sorts the hits and counts the tests by kinds of shapes.
  void finish();
  /// Sends the counts (`kinds`). Returns whether all are sent; if not, call it again.
  bool send_kinds();

  /// Hits in the order of detection, as indices into RegionObjects.
  std::span<const geometry::CandidatePair> hits() const noexcept { return hits_.span(); }
  /// Parallel to hits(): what the kernels returned. Constant until the next discard().
  std::span<const narrow_phase::PairContact> touches() const noexcept { return touches_.span(); }
  /// The hits in order of the numbers (a, b). After finish().
  const base::PairSort& order() const noexcept { return order_; }
  /// The numbers of this frame for the server. After finish().
  messages::NarrowDoneRecord totals() const noexcept { return {candidates_, tested_, hits_.size(), failed_supports_}; }

 private:
  static constexpr std::size_t pairs_per_test = 4096;

  void sweep();
  void test_pairs();
  void add_hits(std::span<const narrow_phase::PairContact> found);
  void count_kinds();

  NodeState& state_;
  broad_phase::SweepAndPrune sweep_;
  narrow_phase::NarrowPhase narrow_;
  std::vector<geometry::CandidatePair> pairs_;         ///< indices into RegionObjects; not yet tested
  base::FlatList<geometry::CandidatePair> hits_;       ///< lower number first
  base::FlatList<narrow_phase::PairContact> touches_;  ///< parallel to hits_
  base::PairSort order_;
  std::uint64_t candidates_ = 0;
  /// The kernels themselves count, so that "each pair once" is checked against the tests that were done, not those
  /// requested.
  std::uint64_t tested_ = 0;
  std::uint64_t failed_supports_ = 0;
  std::vector<messages::KindRecord> kinds_;
  messages::RunSender kinds_run_;
};

}  // namespace ringfence::nodes
