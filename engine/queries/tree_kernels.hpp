#pragma once

#include <cstdint>
#include <span>

#include "queries/box_tree.hpp"

namespace ringfence::queries {

/// What a search calls for each box that the query may reach: `context` is the caller's, `box` a position in the order
/// of the tree, `limit` the largest fraction or distance that is of interest. Returns the limit from now on: not
/// larger, negative to end the search. Must not throw.
using VisitBox = double (*)(void* context, std::uint32_t box, double limit);

/// The boxes that the queries of a batch reach, as columns, and the room for them.
struct Candidates {
  std::uint32_t* queries;
  std::uint32_t* boxes;  ///< positions in the order of the tree
  float* at;             ///< lower bounds of the fractions at which they are reached; of near_all: see there
  std::size_t size;
  std::size_t room;
};

/// Elements that a search for a batch may write behind each of its lists.
inline constexpr std::size_t stream_slack = 16;

/// What a search for a batch writes: lists as long as those of Candidates, for the levels of the tree above the boxes.
struct StreamMemory {
  std::uint32_t* queries;
  std::uint32_t* groups;
};

/// A search for a batch: sets the candidates to the boxes that each query reaches, in the order of the queries and then
/// of the tree. False if there is too little room for them, or for what is reached in a level above. Precondition:
/// the room is larger than the number of queries. Adds the number of boxes that were compared to `boxes`.
using BatchSearch = bool (*)(const BoxTree& tree, std::span<const Reach> reaches, const StreamMemory& memory,
                             Candidates& out, std::uint64_t& boxes);

/// What list_touched() writes.
struct TouchMemory {
  std::uint32_t* groups[2];  ///< two lists as long as a level of groups, and stream_slack
  /// The first box of each range and the one behind its last: as long as the boxes, and stream_slack.
  std::uint32_t* ends;
};

/// The leaves of a tree and the searches in it, compiled for each instruction set and selected at run time. All
/// versions visit each box that the query reaches within the limit; which others they visit, and in what order, may
/// differ. They return the number of boxes that they compared.
struct TreeKernels {
  /// Sets the boxes of these rows, eight to a group, for the `wanted` groups.
  void (*fill_leaves)(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted,
                      BoxGroup* groups);
  /// Sets the boxes of `count` nodes, 1 to 8, to those around their groups of children.
  void (*fill_nodes)(const BoxGroup* children, std::size_t count, BoxGroup& out);
  /// Boxes that are reached at a fraction of at most `limit`, about in the order of the fractions.
  std::uint64_t (*reach)(const BoxTree& tree, const Reach& reach, double limit, VisitBox visit, void* context);
  /// The same for a batch, with the limit of each query.
  BatchSearch reach_all;
  /// Boxes within a distance of `limit` metres of a point, about in the order of the distances. The point is
  /// `reach.lower` and `reach.upper`.
  std::uint64_t (*near)(const BoxTree& tree, const Reach& reach, double limit, VisitBox visit, void* context);
  /// The same for a batch, with the limit of each query. Candidates::at is the square of a lower bound of the distance.
  BatchSearch near_all;
  /// Lists the boxes that overlap or touch `box`, and no others, in the order of the tree, as ranges: neighbours in the
  /// order are one range. Returns the number of ranges.
  std::size_t (*list_touched)(const BoxTree& tree, const TreeBox& box, const TouchMemory& memory);
};

/// The kernels for the widest instruction set that this machine supports and Highway does not exclude.
TreeKernels choose_tree_kernels();

}  // namespace ringfence::queries
