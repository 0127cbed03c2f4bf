#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "scale_run.hpp"

namespace ringfence::tools {

/// Distribution of a value over the repeats of a combination.
struct Range {
  double median = 0, min = 0, max = 0;
};
Range range_of(const std::vector<double>& values);

/// Comparison of the time T(p) at p nodes with the time T(1) at one node, for the same world.
struct Scaling {
  bool known = false;          ///< false: T(1) was not measured, and the other fields are 0
  double speedup = 0;          ///< T(1) / T(p)
  double efficiency = 0;       ///< speedup / p
  double serial_fraction = 0;  ///< Karp and Flatt 1990: (1/speedup - 1/p) / (1 - 1/p); 0 at one node
};
Scaling scaling_of(double one_node_ms, double ms, std::uint32_t nodes);

/// One combination of options and the results of its repeats.
struct ScaleRow {
  Deployment deployment = Deployment::user;
  Placement placement = Placement::server;
  std::uint32_t nodes = 1;
  std::uint32_t objects = 0;
  std::uint32_t user_threads = 1;
  std::vector<ScaleSample> samples;

  // summarise() computes the following, times in milliseconds.
  Range wall, server, node, users;
  Range modelled;     ///< CPU time along the critical path plus the message latency of an empty frame
  Range undisturbed;  ///< the same for ScaleSample::undisturbed_ms
  double imbalance = 1;
  bool cores_suffice = false;  ///< all concurrent threads have a core, so that wall times show the scaling
  Scaling modelled_scaling, undisturbed_scaling, wall_scaling;

  const FrameCounts& counts() const { return samples.back().counts; }
  std::uint64_t digest() const { return samples.front().digest; }
  bool same_world(const ScaleRow& other) const {
    return deployment == other.deployment && placement == other.placement && objects == other.objects;
  }
};

/// Computes the summary of all rows. `hops_ms` is the message latency of an empty frame, `cores` the number of
/// usable cores.
void summarise(std::vector<ScaleRow>& rows, double hops_ms, unsigned cores);

/// The row of the same world at `nodes` nodes; null if there is none.
const ScaleRow* find_row(const std::vector<ScaleRow>& rows, const ScaleRow& world, std::uint32_t nodes);

/// One message for each run whose digest differs from the first run with the same object count.
std::vector<std::string> digest_disagreements(const std::vector<ScaleRow>& rows);

}  // namespace ringfence::tools
