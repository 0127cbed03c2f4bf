#include "profile.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "queries/query_report.hpp"
#include "report.hpp"

namespace ringfence::tools {
namespace {

constexpr std::size_t max_profiled_nodes = 32;

double share(double part, double whole) { return whole > 0 ? part / whole : 0; }
double share(std::uint64_t part, std::uint64_t whole) {
  return share(static_cast<double>(part), static_cast<double>(whole));
}

/// The cost below which the share `rank` (0 to 1) of the timed sample lies, interpolated within a bucket.
double percentile(const KindReport& kind, double rank) {
  std::uint64_t all = 0;
  for (const std::uint64_t count : kind.cost) all += count;
  double left = rank * static_cast<double>(all);
  for (std::size_t i = 0; i < cost_buckets; ++i) {
    const auto count = static_cast<double>(kind.cost[i]);
    if (count > 0 && left <= count) return std::exp2((static_cast<double>(i) + left / count) / 2);
    left -= count;
  }
  return 0;
}

/// Mean cost in nanoseconds without samples of 32 times the median or more. Otherwise one thread that is preempted
/// while it times a block dominates the mean. The result is exact if there are no such samples.
double mean_uninterrupted(const KindReport& kind, double p50) {
  double counted = 0, sum = 0;
  bool interrupted = false;
  for (std::size_t i = 0; i < cost_buckets; ++i) {
    const auto count = static_cast<double>(kind.cost[i]);
    if (std::exp2(static_cast<double>(i) / 2) < 32 * p50) {
      counted += count;
      sum += count * std::exp2((static_cast<double>(i) + 0.5) / 2);
    } else {
      interrupted |= count > 0;
    }
  }
  if (interrupted && counted > 0) return sum / counted;
  return static_cast<double>(kind.nanoseconds) / static_cast<double>(kind.timed);
}

double estimated_ns(const KindReport& kind) { return candidate_cost(kind).mean * static_cast<double>(kind.candidates); }

double all_estimated_ns(const Figures& figures) {
  double all = 0;
  for (const KindReport& kind : figures.kinds()) all += estimated_ns(kind);
  return all;
}

double narrow_phase_ms(const Figures& figures) {
  double all = 0;
  for (const NodeFigures& node : figures.nodes()) all += node.narrow_phase_ms;
  return all;
}

std::string percent(double share) { return fmt::format("{:.1f} %", 100 * share); }

void print_kinds(std::FILE* out, const Figures& figures) {
  const double all = all_estimated_ns(figures);
  fmt::print(out, "{:<19} {:>10} {:>7} {:>8} {:>8} {:>8} {:>8} {:>8} {:>6} {:>8} {:>8} {:>8}\n", "pair", "candidates",
             "hits", "ns mean", "p50", "p90", "p99", "share", "lanes", "steps", "early", "gather");
  for (const KindReport& kind : by_cost(figures)) {
    const CandidateCost cost = candidate_cost(kind);
    const auto candidates = static_cast<double>(kind.candidates);
    fmt::print(out, "{:<19} {:>10.1f} {:>7} {:>8.1f} {:>8.1f} {:>8.1f} {:>8.1f} {:>8} {:>6} {:>8} {:>8} {:>8}\n",
               fmt::format("{}-{}", name_of(kind.first), name_of(kind.second)), figures.mean(candidates),
               percent(share(kind.hits, kind.candidates)), cost.mean, cost.p50, cost.p90, cost.p99,
               percent(share(estimated_ns(kind), all)),
               kind.lanes > 0 ? fmt::format("{:.0f} %", 100 * share(kind.lanes_filled, kind.lanes)) : "-",
               kind.iterations > 0 ? fmt::format("{:.1f}", static_cast<double>(kind.iterations) / candidates) : "-",
               percent(share(kind.ended_early, kind.candidates)),
               percent(share(kind.gather_nanoseconds, kind.nanoseconds)));
  }
}

void print_profiled_nodes(std::FILE* out, const Figures& figures) {
  const std::vector<NodeFigures> nodes = figures.nodes();
  fmt::print(out, "{:<6} {:>9} {:>9} {:>9} {:>10} {:>12} {:>14} {:>9} {:>8}\n", "node", "busy ms", "wait ms", "cpu ms",
             "move ms", "sweep ms", "narrow ph. ms", "tested", "share");
  double all = 0;
  for (const NodeFigures& node : nodes) all += node.tested;
  for (std::size_t i = 0; i < std::min(nodes.size(), max_profiled_nodes); ++i) {
    const NodeFigures& node = nodes[i];
    fmt::print(out, "{:<6} {:>9.3f} {:>9.3f} {:>9.3f} {:>10.3f} {:>12.3f} {:>14.3f} {:>9.0f} {:>8}\n", node.id,
               node.busy_ms, node.wait_ms, node.cpu_ms, node.move_ms, node.broad_phase_ms, node.narrow_phase_ms,
               node.tested, percent(share(node.tested, all)));
  }
  if (nodes.size() > max_profiled_nodes) {
    fmt::print(out, "{} more in the JSON report (--json FILE)\n", nodes.size() - max_profiled_nodes);
  }
  const Imbalance& imbalance = figures.cpu_imbalance;
  if (imbalance.windows() == 0) {
    fmt::print(out, "imbalance   not measured: fewer than {} frames\n", Imbalance::window);
  } else {
    fmt::print(out,
               "imbalance   {:.2f}, at most {:.2f}: CPU time of the busiest node over the mean of all, in windows of "
               "{} frames\n",
               imbalance.mean(), imbalance.max(), Imbalance::window);
  }
}

}  // namespace

CandidateCost candidate_cost(const KindReport& kind) {
  if (kind.timed == 0) return {};
  const double p50 = percentile(kind, 0.5);
  return {mean_uninterrupted(kind, p50), p50, percentile(kind, 0.9), percentile(kind, 0.99)};
}

std::vector<KindReport> by_cost(const Figures& figures) {
  std::vector<KindReport> kinds = figures.kinds();
  std::stable_sort(kinds.begin(), kinds.end(),
                   [](const KindReport& p, const KindReport& q) { return estimated_ns(p) > estimated_ns(q); });
  return kinds;
}

void print_profile(std::FILE* out, const Job& job, const Figures& figures) {
  const Spread frame = figures.frame_ms();
  const double narrow = narrow_phase_ms(figures);
  fmt::print(out, "{}\n{}, {} CD node{}, broad phase: {}; {}\n\n", job.title, name_of(job.service.deployment),
             job.service.nodes, job.service.nodes == 1 ? "" : "s", placement_of(job.service, figures),
             counted_frames(job, figures));
  std::uint64_t timed = 0, candidates = 0;
  for (const KindReport& kind : figures.kinds()) {
    timed += kind.timed;
    candidates += kind.candidates;
  }
  fmt::print(out, "frame       mean {:.3f} ms   p50 {:.3f}   p99 {:.3f}\n", frame.mean, frame.p50, frame.p99);
  fmt::print(out, "narrow phase {:.3f} ms on all nodes; {:.3f} ms of it in kernels, estimated from a sample of {}\n\n",
             narrow, figures.mean(all_estimated_ns(figures)) * 1e-6, percent(share(timed, candidates)));
  print_kinds(out, figures);
  fmt::print(out, "\n");
  print_profiled_nodes(out, figures);
  print_queries(out, figures);
  fmt::print(out, "digest      {:016x}\n", figures.digest());
}

nlohmann::ordered_json profile_json(const Figures& figures) {
  const double all = all_estimated_ns(figures);
  nlohmann::ordered_json json = {{"narrow_phase_ms", narrow_phase_ms(figures)},
                                 {"kernels_ms", figures.mean(all) * 1e-6},
                                 {"imbalance", figures.cpu_imbalance.mean()},
                                 {"kinds", nlohmann::ordered_json::array()}};
  for (const KindReport& kind : by_cost(figures)) {
    const CandidateCost cost = candidate_cost(kind);
    json["kinds"].push_back(
        {{"first", name_of(kind.first)},
         {"second", name_of(kind.second)},
         {"candidates", figures.mean(static_cast<double>(kind.candidates))},
         {"hit_share", share(kind.hits, kind.candidates)},
         {"ns_per_candidate", {{"mean", cost.mean}, {"p50", cost.p50}, {"p90", cost.p90}, {"p99", cost.p99}}},
         {"share", share(estimated_ns(kind), all)},
         {"lane_use", share(kind.lanes_filled, kind.lanes)},
         {"iterations", share(kind.iterations, kind.candidates)},
         {"ended_early_share", share(kind.ended_early, kind.candidates)},
         {"gather_share", share(kind.gather_nanoseconds, kind.nanoseconds)}});
  }
  return json;
}

}  // namespace ringfence::tools
