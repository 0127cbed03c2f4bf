#include "scale_rows.hpp"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "medians.hpp"

namespace ringfence::tools {
namespace {

template <class Value>
Range over_samples(const ScaleRow& row, Value value) {
  std::vector<double> values;
  for (const ScaleSample& sample : row.samples) values.push_back(value(sample));
  return range_of(values);
}

}  // namespace

Range range_of(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  return {median(values), *min, *max};
}

Scaling scaling_of(double one_node_ms, double ms, std::uint32_t nodes) {
  if (nodes == 0 || !(one_node_ms > 0) || !(ms > 0)) return {};
  Scaling scaling{true, one_node_ms / ms, 0, 0};
  const double p = nodes;
  scaling.efficiency = scaling.speedup / p;
  if (nodes > 1) scaling.serial_fraction = (1 / scaling.speedup - 1 / p) / (1 - 1 / p);
  return scaling;
}

const ScaleRow* find_row(const std::vector<ScaleRow>& rows, const ScaleRow& world, std::uint32_t nodes) {
  for (const ScaleRow& row : rows) {
    if (row.same_world(world) && row.nodes == nodes) return &row;
  }
  return nullptr;
}

void summarise(std::vector<ScaleRow>& rows, double hops_ms, unsigned cores) {
  for (ScaleRow& row : rows) {
    row.wall = over_samples(row, [](const ScaleSample& sample) { return sample.wall_ms; });
    row.server = over_samples(row, [](const ScaleSample& sample) { return sample.server_ms; });
    row.node = over_samples(row, [](const ScaleSample& sample) { return sample.node_ms; });
    row.users = over_samples(row, [](const ScaleSample& sample) { return sample.users_ms; });
    const double hops = row.nodes > 0 ? hops_ms : 0;
    row.modelled = over_samples(row, [hops](const ScaleSample& sample) { return sample.path_ms + hops; });
    row.undisturbed = over_samples(row, [hops](const ScaleSample& sample) { return sample.undisturbed_ms + hops; });
    row.imbalance = over_samples(row, [](const ScaleSample& sample) { return sample.imbalance; }).median;
    // Frames are lock-step: at any time only the server and either the nodes or the users work.
    row.cores_suffice = row.nodes == 0 || 1 + std::max(row.nodes, row.user_threads) <= cores;
  }
  for (ScaleRow& row : rows) {
    const ScaleRow* one = find_row(rows, row, 1);
    if (one == nullptr) continue;
    row.modelled_scaling = scaling_of(one->modelled.median, row.modelled.median, row.nodes);
    row.undisturbed_scaling = scaling_of(one->undisturbed.median, row.undisturbed.median, row.nodes);
    row.wall_scaling = scaling_of(one->wall.median, row.wall.median, row.nodes);
  }
}

std::vector<std::string> digest_disagreements(const std::vector<ScaleRow>& rows) {
  std::map<std::uint32_t, std::uint64_t> expected;
  std::vector<std::string> lines;
  for (const ScaleRow& row : rows) {
    for (const ScaleSample& sample : row.samples) {
      const std::uint64_t digest = expected.emplace(row.objects, sample.digest).first->second;
      if (sample.digest == digest) continue;
      lines.push_back(fmt::format("{} objects, {}, {}, {} nodes: digest {:016x}; expected {:016x} as in the first run",
                                  row.objects, name_of(row.deployment), name_of(row.placement), row.nodes,
                                  sample.digest, digest));
    }
  }
  return lines;
}

}  // namespace ringfence::tools
