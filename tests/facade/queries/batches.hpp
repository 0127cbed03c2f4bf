#pragma once

#include <cstddef>
#include <vector>

#include "facade/queries/random_queries.hpp"
#include "ringfence/query_batch.hpp"

namespace ringfence::test {

/// A batch of these queries.
inline QueryBatch batch_of(const Queries& queries) {
  QueryBatch batch;
  batch.cast = batch.cast_any = batch.cast_all = queries.rays;
  batch.sweep = batch.sweep_all = queries.sweeps;
  batch.overlap = queries.overlaps;
  batch.nearest = queries.nearest;
  return batch;
}

/// The answers in the form and order of answer().
inline Answers answers_of(const QueryBatch& batch) {
  Answers out;
  const auto add_each = [&](const std::vector<Hit>& hits) {
    out.hits.insert(out.hits.end(), hits.begin(), hits.end());
  };
  const auto add_lists = [&](const HitLists& lists) {
    for (std::size_t i = 0; i < lists.size(); ++i) {
      out.hits.insert(out.hits.end(), lists[i].begin(), lists[i].end());
      Hit end;
      end.status = lists.status(i);
      out.hits.push_back(end);
    }
  };
  const QueryBatch::Answers& answers = batch.answers;
  add_each(answers.cast);
  add_each(answers.sweep);
  add_each(answers.nearest);
  add_lists(answers.cast_all);
  add_lists(answers.sweep_all);
  add_lists(answers.overlap);
  for (const AnyHit& any : answers.cast_any) {
    Hit as_hit;
    as_hit.status = any.status;
    as_hit.triangle = any.hit ? 1 : 0;
    out.hits.push_back(as_hit);
  }
  return out;
}

}  // namespace ringfence::test
