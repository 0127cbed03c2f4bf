#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/flat_list.hpp"
#include "base/frame_stamp.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/cd_node/queries/query_answers.hpp"
#include "queries/frame_part.hpp"
#include "queries/tree_box.hpp"

namespace ringfence::nodes {

/// Answers the queries of a frame (NodeQueries) for the objects that a CD node owns.
///
/// A present object belongs to the node whose region has the lower corner of its bounds. That is the rule for pairs,
/// applied to the pair of the object with itself, so each object belongs to one node that knows it. An object whose
/// bounds touch only this node's region needs no computation. What has not changed since the frame with queries before
/// stays in the index.
///
/// Threads: belongs to the CD node. Memory: nothing without queries; grows to the largest frame with queries.
class QueryAnswerer {
 public:
  explicit QueryAnswerer(NodeState& state) : state_(state) {}

  /// When the poses of the frame are final, while RegionObjects and the map are those of the tests: builds the index of
  /// the owned objects. From then on the two may change.
  void begin();
  /// Whether queries are still to be answered.
  bool is_pending() const noexcept { return pending_; }
  /// Answers the next queries. Precondition: is_pending().
  void answer_some();
  /// The frame is detected again: discards the answers.
  void discard() noexcept {
    pending_ = false;
    built_frame_ = none;
  }

 private:
  static constexpr std::size_t queries_at_once = 1024;
  static constexpr std::uint64_t none = ~std::uint64_t{0};

  void copy_objects();
  void list_owned();
  void add_at_border();
  void own(std::uint32_t known) noexcept {
    row_of_[known] = known;
    ++owned_;
  }
  queries::KnownBounds known_bounds();

  NodeState& state_;
  // Copies of the lists of RegionObjects, with its indices, which are the keys in the index.
  std::vector<queries::FrameObject> rows_;
  std::vector<std::uint32_t> slots_, groups_;
  std::vector<std::uint32_t> row_of_;          ///< the index itself, or none if the node does not own the object
  base::FlatList<queries::RowBounds> bounds_;  ///< empty if the node has no bounds
  std::size_t owned_ = 0;
  std::uint64_t built_frame_ = none;  ///< that part_ was built for, with box_of_
  std::optional<queries::BoxConverter> box_of_;
  std::vector<std::uint32_t> at_border_;  ///< known objects that may belong to another node
  queries::FramePart part_;               ///< refers to rows_
  QueryAnswers answers_;
  std::size_t next_ = 0;  ///< query
  bool pending_ = false;
};

}  // namespace ringfence::nodes
