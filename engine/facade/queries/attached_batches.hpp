#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/shape_table.hpp"
#include "messages/records.hpp"
#include "nodes/host/query_arguments.hpp"
#include "nodes/server/server_role.hpp"
#include "queries/recorded_frame.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/query_batch.hpp"
#include "ringfence/snapshot.hpp"
#include "ringfence/status.hpp"

namespace ringfence::facade {

/// The batches that are attached for a frame: prepares their queries for the CD nodes, and merges what these answer.
///
/// The answer of one node is what it found at its own objects, and each object belongs to one node. So a list is the
/// union of the nodes' lists in order of (fraction, number), and the first hit of all is the least of the nodes' first
/// hits. If a node was lost, a snapshot answers instead.
///
/// Threads: the one that calls World. Memory: grows to the largest frame. Throws only std::bad_alloc.
class AttachedBatches {
 public:
  explicit AttachedBatches(std::shared_ptr<const geometry::ShapeTable> shapes) : shapes_(std::move(shapes), nullptr) {}
  AttachedBatches(const AttachedBatches&) = delete;
  AttachedBatches& operator=(const AttachedBatches&) = delete;

  bool empty() const noexcept { return batches_.empty(); }
  /// Returns out_of_order, and does nothing, if the batch is attached already.
  Status attach(QueryBatch& batch);
  /// Forgets the batches: they are not answered.
  void detach() noexcept { batches_.clear(); }

  // The steps of a frame.
  /// A frame begins: checks the queries and gives those that the nodes answer to `order`.
  void prepare(nodes::FrameOrder& order);
  /// The frame is complete: answers all batches and detaches them. `snapshot` returns one of that frame; it is called
  /// only if the nodes cannot have answered everything. Call it before nodes are removed.
  void answer(const nodes::ServerRole& server, FrameReport& report, const std::function<Snapshot()>& snapshot);
  /// Precondition: the threads of all lost nodes have ended, and no frame is running.
  void free_abandoned() noexcept { abandoned_.clear(); }

 private:
  /// What is known of a query before the frame.
  struct Prepared {
    Status status = Status::ok;
    bool by_nodes = false;  ///< it is the next of records_
  };
  /// What a node found for a query.
  struct Found {
    double place;
    ObjectNumber number;
    const messages::QueryHitRecord* hit;
  };

  template <class Asked, class Query>
  void prepare(messages::QueryKind kind, const std::vector<Query>& of_kind);
  void order_hits(const nodes::ServerRole& server);
  std::span<const Found> next_found();
  void merge(QueryBatch& batch, const nodes::ServerRole& server, const Snapshot& snapshot, QueryWork& work);
  template <class Query>
  void merge_first(const std::vector<Query>& queries, std::vector<Hit>& hits, const nodes::ServerRole& server,
                   void (Snapshot::*otherwise)(std::span<const Query>, std::span<Hit>, QueryWork*) const noexcept,
                   const Snapshot& snapshot, QueryWork& work);
  template <class Query>
  void merge_lists(const std::vector<Query>& queries, HitLists& lists, const nodes::ServerRole& server,
                   void (Snapshot::*otherwise)(std::span<const Query>, HitLists&, QueryWork*) const,
                   const Snapshot& snapshot, QueryWork& work);
  void merge_any(const std::vector<RayQuery>& queries, std::vector<AnyHit>& hits, const Snapshot& snapshot,
                 QueryWork& work);

  queries::RecordedFrame shapes_;  ///< without objects: the shapes that are registered when a frame begins
  std::vector<QueryBatch*> batches_;
  std::vector<messages::QueryRecord> records_;                 ///< read by the nodes while the frame is running
  std::vector<Prepared> prepared_;                             ///< of all queries, in order
  bool any_by_snapshot_ = false;                               ///< a query is neither refused nor in records_
  std::vector<std::vector<messages::QueryRecord>> abandoned_;  ///< lost nodes may still read them
  // While answers are merged.
  std::vector<const nodes::NodeQueries*> answers_;
  std::vector<std::size_t> ends_;  ///< by record: end of its hits in found_
  std::vector<Found> found_;       ///< in order of record, then of (place, number)
  std::size_t next_prepared_ = 0, next_record_ = 0;
  HitLists list_;  ///< of one query
};

}  // namespace ringfence::facade
