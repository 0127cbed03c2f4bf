#pragma once

#include <cstdio>

#include <nlohmann/json.hpp>

#include "figures.hpp"
#include "job.hpp"

namespace ringfence::tools {

/// What a candidate of two kinds of shapes cost, nanoseconds; 0 where none was timed.
struct CandidateCost {
  double mean = 0, p50 = 0, p90 = 0, p99 = 0;
};

/// From the timed sample. Percentiles are read off KindReport::cost, so they are exact to the width of a bucket, a
/// factor of 1.41; within one they are interpolated. The mean leaves out what cost 32 times the median and more, which
/// is a thread that lost its core, and is then read off the buckets too.
CandidateCost candidate_cost(const KindReport& kind);

/// All pairs of kinds, by the time that they are estimated to take: mean times candidates, most first.
std::vector<KindReport> by_cost(const Figures& figures);

/// Where the narrow phase spent its time, and how evenly the nodes shared it: what `ringfence profile` prints.
void print_profile(std::FILE* out, const Job& job, const Figures& figures);

/// The same under `profile` in the JSON.
nlohmann::ordered_json profile_json(const Figures& figures);

}  // namespace ringfence::tools
