#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "scale_run.hpp"

namespace ringfence::tools {

/// A figure over the repeats of a combination.
struct Range {
  double median = 0, min = 0, max = 0;
};
Range range_of(const std::vector<double>& values);

/// How a time at p nodes compares with that at one node of the same world.
struct Scaling {
  bool known = false;          ///< whether there is such a time
  double speedup = 0;          ///< T(1) / T(p)
  double efficiency = 0;       ///< speedup / p
  double serial_fraction = 0;  ///< Karp and Flatt 1990: (1/speedup - 1/p) / (1 - 1/p); 0 at one node
};
Scaling scaling_of(double one_node_ms, double ms, std::uint32_t nodes);

/// One combination: what its repeats came to.
struct ScaleRow {
  Deployment deployment = Deployment::user;
  Placement placement = Placement::server;
  std::uint32_t nodes = 1;
  std::uint32_t objects = 0;
  std::uint32_t user_threads = 1;
  std::vector<ScaleSample> samples;

  /// Below: filled by summarise().
  Range wall, server, node, users;
  Range modelled;  ///< critical path of CPU times and the messages of an empty frame
  double imbalance = 1;
  bool cores_suffice = false;  ///< all threads that work at the same time have a core, so wall time shows scaling
  Scaling modelled_scaling, wall_scaling;

  const FrameCounts& counts() const { return samples.back().counts; }
  std::uint64_t digest() const { return samples.front().digest; }
  bool same_world(const ScaleRow& other) const {
    return deployment == other.deployment && placement == other.placement && objects == other.objects;
  }
};

/// Fills the figures of all rows. `hops_ms` is what the messages of an empty frame take, `cores` those of the machine.
void summarise(std::vector<ScaleRow>& rows, double hops_ms, unsigned cores);

/// The row of the same world at `nodes` nodes; null if it was not run.
const ScaleRow* find_row(const std::vector<ScaleRow>& rows, const ScaleRow& world, std::uint32_t nodes);

/// Object counts whose runs differ in their digest, in words; empty if none do.
std::vector<std::string> digest_disagreements(const std::vector<ScaleRow>& rows);

}  // namespace ringfence::tools
