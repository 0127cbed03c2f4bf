#pragma once

#include <cstdint>
#include <vector>

#include "ringfence/query.hpp"

namespace ringfence {

/// Queries of all kinds that the CD nodes answer in parallel, for the frame that is about to run (World::attach).
///
///   ringfence::QueryBatch batch;
///   batch.cast.push_back({.start = eye, .displacement = view});
///   world.attach(batch);
///   world.advance();
///   if (const ringfence::Hit& hit = batch.answers.cast[0]) shoot(hit.object);
///
/// The answers are about the objects after that frame. They are those that World::snapshot() gives after the frame for
/// the same queries, bit for bit. Each query is checked on its own when the frame begins: what is wrong with it is in
/// its answer, and the others are answered.
///
/// Queries about another frame (QueryFrame), and all queries of a frame in which a CD node is lost, are answered by the
/// thread that calls World::finish_frame.
///
/// Lifetime: from attach() until finish_frame returns or the World is destroyed, the batch stays where it is and is not
/// changed. Meant to be used again: with as many queries and hits as before nothing is allocated. If finish_frame
/// returns Status::out_of_memory, the answers are those of an earlier frame or incomplete.
struct QueryBatch {
  // The queries; the meaning is that of the functions of Snapshot with these names.
  std::vector<RayQuery> cast, cast_any, cast_all;
  std::vector<SweepQuery> sweep, sweep_all;
  std::vector<OverlapQuery> overlap;
  std::vector<NearestQuery> nearest;

  /// In the order of the queries.
  struct Answers {
    static constexpr std::uint64_t no_frame = ~std::uint64_t{0};
    std::uint64_t frame = no_frame;  ///< FrameReport::frame of the frame that they belong to
    std::vector<Hit> cast;
    std::vector<AnyHit> cast_any;
    HitLists cast_all;
    std::vector<Hit> sweep;
    HitLists sweep_all;
    HitLists overlap;
    std::vector<Hit> nearest;
  };
  Answers answers;  ///< set by finish_frame
};

}  // namespace ringfence
