#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "messages/records.hpp"

namespace ringfence::nodes {

/// The queries of a frame and the answers of one CD node, in memory that the roles of a process share.
///
/// Every node reads the same queries, and answers each for the present objects that it owns: those whose bounds have
/// their lower corner in its region, so each object belongs to one node.
///
/// Threads: the server writes `queries` before `frame_begin`; it never does so again for a node that is lost, whose
/// thread may still read them. So whoever owns the queries keeps them until such threads have ended. The node writes
/// the rest before `frame_done`; then the facade reads it until the next frame begins.
struct NodeQueries {
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};

  std::span<const messages::QueryRecord> queries;  ///< of this frame; empty: none
  std::uint64_t frame = no_frame;                  ///< the last frame whose queries are all answered in `hits`
  std::vector<messages::QueryHitRecord> hits;      ///< in order of query
};

}  // namespace ringfence::nodes
