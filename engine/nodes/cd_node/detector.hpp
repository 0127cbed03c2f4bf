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
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

/// Finds the hits of a CD node: the candidate pairs that it owns and whose shapes are in contact. The pairs come from
/// the server, or from a sweep of the node's RegionObjects.
///
/// Pairs are tested in batches that are large enough for full blocks of every pair of kinds, and small enough that the
/// objects of a batch stay in the cache from the sort to the kernels. If the node sweeps, a pair of two objects of
/// which nothing has changed is carried over: its result is that of the frame before, bit for bit, because the kernels
/// are functions of the two objects alone. Pairs with support functions are always tested, so that a failure is
/// counted.
///
/// Threads: belongs to the CD node. Memory: grows to the largest two frames.
class Detector {
 public:
  explicit Detector(NodeState& state);

  /// Starts a frame: the hits of the last one serve only to carry results over.
  void begin();
  /// Discards pairs and hits, before a frame is detected again. Nothing is carried over to the next detection.
  void discard();
  /// Adds the pairs of a `pairs` message and tests the full batches.
  void receive_pairs(const messages::MessageView& message);
  /// When all positions and pairs have arrived: sweeps, if the node does, and tests all that is left.
  void test_all();
  /// Then: sorts the hits and counts the tests by kinds of shapes.
  void finish();
  /// Then: the tests by kinds of shapes, until the next finish().
  std::span<const messages::KindRecord> kinds() const noexcept { return kinds_; }

  /// Hits in the order of detection, as indices into RegionObjects.
  std::span<const geometry::CandidatePair> hits() const noexcept { return hits_.span(); }
  /// Parallel to hits(): what the kernels returned. Constant until the next begin() or discard().
  std::span<const narrow_phase::PairContact> touches() const noexcept { return touches_.span(); }
  /// The hits in order of the numbers (a, b). After finish().
  const base::PairSort& order() const noexcept { return order_; }
  /// The numbers of this frame for the server. After finish().
  messages::NarrowDoneRecord totals() const noexcept {
    return {candidates_, tested_, carried_, hits_.size(), failed_supports_};
  }

 private:
  static constexpr std::size_t pairs_per_test = 4096;

  // The words of SweepAndPrune::kept_words(): what is known of a pair. From first_hit on: the number of its hit in the
  // last frame.
  static constexpr std::uint32_t untested = 0, apart = 1, of_other_node = 2, first_hit = 3;

  void clear();
  void sweep();
  std::size_t add_kept_pairs(std::span<const geometry::CandidatePair> found);
  void add_pairs(std::span<const geometry::CandidatePair> found);
  bool may_carry(const geometry::CandidatePair& pair) const noexcept;
  void test_pairs();
  void add_hits(std::span<const narrow_phase::PairContact> found);
  void count_kinds();

  NodeState& state_;
  broad_phase::SweepAndPrune sweep_;
  narrow_phase::NarrowPhase narrow_;
  std::vector<geometry::CandidatePair> pairs_;         ///< indices into RegionObjects; not yet tested
  base::FlatList<geometry::CandidatePair> hits_;       ///< lower number first
  base::FlatList<narrow_phase::PairContact> touches_;  ///< parallel to hits_
  base::FlatList<geometry::CandidatePair> last_hits_;  ///< of the frame before
  base::FlatList<narrow_phase::PairContact> last_touches_;
  std::span<std::uint32_t> known_;             ///< words of the sweep, for the pairs that it returns first
  std::vector<std::uint32_t*> kept_of_batch_;  ///< words of the first pairs of pairs_; null: not carried over
  std::size_t returned_ = 0;                   ///< pairs that the sweep has returned
  bool has_swept_ = false;                     ///< in this frame
  bool knows_last_frame_ = false;              ///< the words are about last_hits_
  base::PairSort order_;
  std::uint64_t candidates_ = 0;
  /// The kernels themselves count, so that "each pair once" is checked against the tests that were done, not those
  /// requested.
  std::uint64_t tested_ = 0;
  std::uint64_t carried_ = 0;
  std::uint64_t failed_supports_ = 0;
  std::vector<messages::KindRecord> kinds_;
};

}  // namespace ringfence::nodes
