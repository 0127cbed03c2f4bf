#pragma once

#include <cstdio>

#include <nlohmann/json.hpp>

#include "figures.hpp"
#include "job.hpp"

namespace ringfence::tools {

/// Cost of a candidate of one pair of shape kinds, in nanoseconds; 0 if none was timed.
struct CandidateCost {
  double mean = 0, p50 = 0, p90 = 0, p99 = 0;
};

/// Computes the cost from the timed sample. Percentiles come from the histogram KindReport::cost and are interpolated
/// within a bucket, whose width is a factor of 1.41. The mean excludes samples of 32 times the median or more, because
/// such a thread was preempted; in that case the mean also comes from the histogram.
CandidateCost candidate_cost(const KindReport& kind);

/// All pairs of kinds, sorted by their estimated total time (mean cost times candidates) in descending order.
std::vector<KindReport> by_cost(const Figures& figures);

/// Prints the report of `ringfence profile`: the cost of each pair of kinds, and the distribution over the nodes.
void print_profile(std::FILE* out, const Job& job, const Figures& figures);

/// The value of `profile` in the JSON report.
nlohmann::ordered_json profile_json(const Figures& figures);

}  // namespace ringfence::tools
