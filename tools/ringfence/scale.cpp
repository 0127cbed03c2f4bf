#include "scale.hpp"

#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cluster_model.hpp"
#include "exit_code.hpp"
#include "link/scoped_batch_scheduling.hpp"
#include "machine.hpp"
#include "plots.hpp"
#include "progress.hpp"
#include "scale_report.hpp"
#include "stop_signals.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t nodes_beyond[] = {64, 256, 1024};

template <class Value>
std::vector<Value> sorted(std::vector<Value> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

std::vector<ScaleRow> rows_of(const ScaleOptions& options) {
  std::vector<ScaleRow> rows;
  for (const std::uint32_t objects : sorted(options.objects)) {
    for (const Deployment deployment : sorted(options.deployments)) {
      for (const Placement placement : sorted(options.placements)) {
        for (const std::uint32_t nodes : sorted(options.nodes)) {
          ScaleRow& row = rows.emplace_back();
          row.objects = objects;
          row.deployment = deployment;
          row.placement = placement;
          row.nodes = nodes;
          row.user_threads = options.base.service.user_threads;
        }
      }
    }
  }
  return rows;
}

/// Measures the message latency of a frame in milliseconds: wake-ups and transfers through rings. It is the difference
/// between wall time and CPU time of frames with one object.
double measure_hops(const ScaleOptions& options, const StopSignals& stop) {
  RunOptions empty = options.base;
  empty.world.objects = 1;
  empty.world.users = empty.service.users = 1;
  empty.service.nodes = 1;
  empty.service.user_threads = 1;
  empty.service.deployment = Deployment::user;
  empty.frames = {400, 100};
  const auto sample = run_sample(make_job(empty), [&stop] { return stop.received() == nullptr; });
  return sample ? std::max(0.0, sample->wall_ms - sample->path_ms) : 0;
}

/// Runs all combinations until a signal stops it. Removes the rows without a complete run. True if all runs are
/// complete.
bool run_rows(const ScaleOptions& options, const StopSignals& stop, std::vector<ScaleRow>& rows) {
  const std::uint64_t frames = std::uint64_t{options.base.frames.warmup} + options.base.frames.frames;
  std::uint64_t work = 0;
  for (const ScaleRow& row : rows) work += frames * row.objects * options.repeats;
  Progress progress(options.base.output.quiet, work);
  RunOptions run = options.base;
  std::optional<Job> job;
  for (std::uint32_t repeat = 0; repeat < options.repeats; ++repeat) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      ScaleRow& row = rows[i];
      if (!job || run.world.objects != row.objects) {
        run.world.objects = row.objects;
        job = make_job(run);
      }
      job->service.deployment = row.deployment;
      job->service.placement = row.placement;
      job->service.nodes = row.nodes;
      progress.set_text(fmt::format("run {} of {}: {} objects, {}, {} nodes", repeat * rows.size() + i + 1,
                                    rows.size() * options.repeats, row.objects, name_of(row.deployment), row.nodes));
      const auto sample = run_sample(*job, [&] {
        progress.step(row.objects);
        return stop.received() == nullptr;
      });
      if (!sample) {
        std::erase_if(rows, [](const ScaleRow& each) { return each.samples.empty(); });
        return false;
      }
      row.samples.push_back(*sample);
    }
  }
  return true;
}

void check_users(const ScaleOptions& options) {
  const std::uint32_t fewest = *std::min_element(options.objects.begin(), options.objects.end());
  if (options.base.world.users > fewest) {
    throw Error(fmt::format("--users: found {}; expected at most one for each of the {} objects of --objects",
                            options.base.world.users, fewest));
  }
}

bool passed(const std::vector<ScaleRow>& rows) {
  bool right = true;
  for (const std::string& line : digest_disagreements(rows)) {
    right = false;
    fmt::print(stderr, "ringfence: {}\n", line);
  }
  for (const ScaleRow& row : rows) {
    for (const ScaleSample& sample : row.samples) right &= sample.counts_match;
  }
  return right;
}

}  // namespace

int scale(const ScaleOptions& options) {
  check_users(options);
  std::optional<OutputFile> json, csv;
  if (!options.json.empty()) json.emplace(options.json);
  if (!options.csv.empty()) csv.emplace(options.csv);
  if (!options.plots.empty()) check_plots(options.plots);

  // With more threads than cores, a thread that wakes up would preempt another in the middle of a step. The CPU time of
  // that step would then include the context switch and cache misses. The model assumes a core for each thread, so
  // batch scheduling avoids such preemption.
  const link::ScopedBatchScheduling batch_scheduling;
  const StopSignals stop;
  ScaleResult result;
  result.rows = rows_of(options);
  result.hops_ms = measure_hops(options, stop);
  if (!run_rows(options, stop, result.rows)) result.ended_by = stop.received();
  summarise(result.rows, result.hops_ms, usable_cores());
  // Models and plots need all rows.
  const bool complete = result.ended_by == nullptr;
  for (const std::string& name : complete ? options.models : std::vector<std::string>()) {
    ClusterCosts costs = *find_cluster(name);
    replace_costs(costs, options.costs);
    costs = resolve_costs(std::move(costs), result.rows);
    const bool today = costs.name == "today";
    std::vector<ClusterPrediction> predictions =
        predict(result.rows, costs,
                today ? std::vector(std::begin(nodes_beyond), std::end(nodes_beyond)) : std::vector<std::uint32_t>{});
    result.clusters.push_back({std::move(costs), std::move(predictions)});
  }

  print_scale(options.json == "-" || options.csv == "-" ? stderr : stdout, options, result);
  if (json) {
    write_scale_json(*json, options, result);
    json->close();
  }
  if (csv) {
    write_scale_csv(*csv, result);
    csv->close();
  }
  const bool right = passed(result.rows);
  if (complete && !options.plots.empty()) draw_plots(options.plots, result);
  if (!right) return check_failed;
  return complete ? done : incomplete;
}

}  // namespace ringfence::tools
