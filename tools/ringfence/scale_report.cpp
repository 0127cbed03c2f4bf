#include "scale_report.hpp"

#include <algorithm>
#include <set>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "machine.hpp"
#include "report.hpp"

namespace ringfence::tools {
namespace {

using Json = nlohmann::ordered_json;

void print_head(std::FILE* out, const ScaleOptions& options, const ScaleResult& result) {
  const Machine machine = this_machine();
  fmt::print(out, "{} shapes, seed {}; {} users in {} thread{}; medians of {} run{} of {} frames after {} of warm-up\n",
             name_of(options.base.world.shapes), options.base.world.seed, options.base.service.users,
             options.base.service.user_threads, options.base.service.user_threads == 1 ? "" : "s", options.repeats,
             options.repeats == 1 ? "" : "s", options.base.frames.frames, options.base.frames.warmup);
  const std::string usable = machine.usable_cores == machine.cores
                                 ? ""
                                 : fmt::format(", {} of them usable (CPU affinity)", machine.usable_cores);
  fmt::print(out, "{}, {} core{}{}, {}, {} build\n\n", machine.cpu, machine.cores, machine.cores == 1 ? "" : "s",
             usable, machine.compiler, machine.build);
  fmt::print(
      out,
      "The line below the names of the columns says what each column is:\n"
      "wall time    measured on the clock: median (minimum to maximum) of the runs; cannot decrease with more threads "
      "than\n"
      "             usable cores\n"
      "CPU          measured CPU time per frame of the server's thread, the busiest node and the busiest user thread\n"
      "modelled     computed: CPU time along the critical path of each frame plus {:.3f} ms, the message latency of an "
      "empty\n"
      "             frame: the frame time with a core for each thread\n"
      "undisturbed  like modelled, but of the median of each step over the frames, for each node by itself: without "
      "what\n"
      "             held up single nodes in single frames, such as other load on the machine\n"
      "w/m          wall / modelled, where there are enough cores to compare them\n"
      "speedup, efficiency, serial   relative to 1 node; serial: Karp-Flatt fraction\n\n",
      result.hops_ms);
}

std::string serial_column(const Scaling& scaling, std::uint32_t nodes) {
  return scaling.known && nodes > 1 ? fmt::format("{:.1f} %", 100 * scaling.serial_fraction) : "-";
}

std::string scaling_columns(const Scaling& scaling, std::uint32_t nodes) {
  if (!scaling.known) return fmt::format("{:>8} {:>10} {:>8}", "-", "-", "-");
  return fmt::format("{:>7.2f}x {:>8.0f} % {:>8}", scaling.speedup, 100 * scaling.efficiency,
                     serial_column(scaling, nodes));
}

std::string undisturbed_columns(const ScaleRow& row) {
  const Scaling& scaling = row.undisturbed_scaling;
  const std::string speedup = scaling.known ? fmt::format("{:.2f}x", scaling.speedup) : "-";
  return fmt::format("{:>11.3f} {:>11} {:>11}", row.undisturbed.median, speedup, serial_column(scaling, row.nodes));
}

void print_rows(std::FILE* out, const std::vector<ScaleRow>& rows) {
  std::uint32_t objects = 0;
  for (const ScaleRow& row : rows) {
    if (row.objects != objects) {
      objects = row.objects;
      fmt::print(out, "{} objects: {:.0f} candidates and {:.0f} contacts per frame, digest {:016x}\n", row.objects,
                 row.counts().tested, row.counts().contacts, row.digest());
      constexpr auto columns =
          "  {:<14} {:<7} {:>5}  {:<26} {:>8} {:>8} {:>8} {:>9} {:>6} {:>8} {:>10} {:>8} {:>11} {:>11} {:>11}\n";
      fmt::print(out, columns, "deployment", "broad", "nodes", "frame ms", "server", "node", "users", "frame", "w/m",
                 "speedup", "efficiency", "serial", "frame", "speedup", "serial");
      fmt::print(out, columns, "", "", "", "wall time", "CPU", "CPU", "CPU", "modelled", "both", "modelled", "modelled",
                 "modelled", "undisturbed", "undisturbed", "undisturbed");
    }
    const std::string wall = fmt::format("{:.3f} ({:.3f} to {:.3f})", row.wall.median, row.wall.min, row.wall.max);
    const std::string ratio =
        row.cores_suffice ? fmt::format("{:.2f}", row.wall.median / row.modelled.median) : std::string("-");
    fmt::print(out, "  {:<14} {:<7} {:>5}  {:<26} {:>8.3f} {:>8.3f} {:>8.3f} {:>9.3f} {:>6} {} {}\n",
               name_of(row.deployment), name_of(row.placement), row.nodes, wall, row.server.median, row.node.median,
               row.users.median, row.modelled.median, ratio, scaling_columns(row.modelled_scaling, row.nodes),
               undisturbed_columns(row));
  }
  fmt::print(out, "\n");
}

void print_costs(std::FILE* out, const ClusterCosts& costs) {
  for (std::size_t i = 0; i < cost_count; ++i) {
    fmt::print(out, "  {:<16} {:>10.4g}  {}\n", name_of(static_cast<CostName>(i)), costs.costs[i].value,
               costs.costs[i].source);
  }
}

/// What each measure of a run is, by its key in the JSON report, which is also the beginning of its CSV columns.
Json measures_json() {
  return {{"wall_ms", "wall time"},
          {"server_cpu_ms", "CPU time"},
          {"busiest_node_cpu_ms", "CPU time"},
          {"busiest_user_thread_cpu_ms", "CPU time"},
          {"imbalance", "CPU time"},
          {"modelled_ms", "modelled"},
          {"modelled_scaling", "modelled"},
          {"undisturbed_ms", "modelled"},
          {"undisturbed_scaling", "modelled"},
          {"wall_scaling", "wall time"}};
}

/// Object counts in the table: the smallest and the largest. The JSON report has all.
std::set<std::uint32_t> objects_shown(const ClusterResult& cluster) {
  std::set<std::uint32_t> all;
  for (const ClusterPrediction& each : cluster.predictions) all.insert(each.row->objects);
  if (all.empty()) return {};
  return {*all.begin(), *all.rbegin()};
}

void print_cluster(std::FILE* out, const ClusterResult& cluster) {
  const bool paper = std::any_of(cluster.predictions.begin(), cluster.predictions.end(),
                                 [](const ClusterPrediction& each) { return each.paper != nullptr; });
  fmt::print(out, "modelled cluster \"{}\": {}\n", cluster.costs.name, cluster.costs.title);
  print_costs(out, cluster.costs);
  fmt::print(out, "  all times in milliseconds, modelled from these costs and the counts of the runs{}\n",
             paper ? "; the last column: what the paper states" : "");
  const std::set<std::uint32_t> shown = objects_shown(cluster);
  const int digits = cluster.costs.name == "2004" ? 0 : 3;
  fmt::print(out,
             "  {:<14} {:<6} {:>8} {:>6} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}  "
             "{:<14}{}\n",
             "deployment", "broad", "objects", "nodes", "frame ms", "if even", "speedup", "move", "states", "sweep",
             "M2", "narrow", "M3", "M4", "hops", "wait", "saturates", paper ? "the paper" : "");
  bool any_extrapolated = false;
  for (const ClusterPrediction& each : cluster.predictions) {
    const ClusterFrame& frame = each.frame;
    if (!shown.contains(each.row->objects)) continue;
    std::string stated;
    if (each.paper != nullptr) {
      stated = fmt::format("{} {:.0f} ms, {:+.0f} %", each.paper->relation, each.paper->ms,
                           100 * (frame.total() / each.paper->ms - 1));
    }
    any_extrapolated |= each.extrapolated;
    fmt::print(out,
               "  {:<14} {:<6} {:>8} {:>5}{} {:>9.{}f} {:>9.{}f} {:>8} {:>8.{}f} {:>8.{}f} {:>8.{}f} {:>8.{}f} "
               "{:>8.{}f} {:>8.{}f} {:>8.{}f} {:>8.{}f} {:>8.{}f}  {:<14}{}\n",
               name_of(each.row->deployment), name_of(each.row->placement), each.row->objects, each.nodes,
               each.extrapolated ? '*' : ' ', frame.total(), digits, each.even_ms, digits,
               each.scaling.known ? fmt::format("{:.1f}x", each.scaling.speedup) : "-", frame.move, digits,
               frame.states, digits, frame.sweep, digits, frame.m2, digits, frame.narrow, digits, frame.m3, digits,
               frame.m4, digits, frame.hops, digits, frame.wait, digits, each.load.limit(), stated);
  }
  if (any_extrapolated) {
    fmt::print(out,
               "  * counts extrapolated from region geometry and the largest run; all other counts were measured\n");
  }
  fmt::print(out, "\n");
}

Json range_json(const Range& range) { return {{"median", range.median}, {"min", range.min}, {"max", range.max}}; }

Json scaling_json(const Scaling& scaling) {
  if (!scaling.known) return nullptr;
  return {
      {"speedup", scaling.speedup}, {"efficiency", scaling.efficiency}, {"serial_fraction", scaling.serial_fraction}};
}

Json row_json(const ScaleRow& row) {
  const FrameCounts& counts = row.counts();
  Json json = {{"objects", row.objects},
               {"deployment", name_of(row.deployment)},
               {"broad_phase", name_of(row.placement)},
               {"nodes", row.nodes},
               {"digest", fmt::format("{:016x}", row.digest())},
               {"wall_ms", range_json(row.wall)},
               {"server_cpu_ms", range_json(row.server)},
               {"busiest_node_cpu_ms", range_json(row.node)},
               {"busiest_user_thread_cpu_ms", range_json(row.users)},
               {"modelled_ms", range_json(row.modelled)},
               {"undisturbed_ms", range_json(row.undisturbed)},
               {"cores_suffice", row.cores_suffice},
               {"imbalance", row.imbalance},
               {"modelled_scaling", scaling_json(row.modelled_scaling)},
               {"undisturbed_scaling", scaling_json(row.undisturbed_scaling)},
               {"wall_scaling", scaling_json(row.wall_scaling)},
               {"counts",
                {{"moved", counts.moved},
                 {"tested", counts.tested},
                 {"busiest_node_tested", counts.busiest_tested},
                 {"contacts", counts.contacts},
                 {"handed_over", counts.handed_over}}}};
  for (std::size_t i = 0; i < traffic_count; ++i) {
    const MeanTraffic& traffic = counts.traffic[i];
    json["counts"]["traffic"][name_of_traffic(static_cast<Traffic>(i))] = {
        {"messages", traffic.messages}, {"records", traffic.records}, {"bytes", traffic.bytes}};
  }
  return json;
}

Json cluster_json(const ClusterResult& cluster) {
  Json json = {{"name", cluster.costs.name}, {"title", cluster.costs.title}};
  for (std::size_t i = 0; i < cost_count; ++i) {
    json["costs"][name_of(static_cast<CostName>(i))] = {{"value", cluster.costs.costs[i].value},
                                                        {"source", cluster.costs.costs[i].source}};
  }
  json["frames"] = Json::array();
  for (const ClusterPrediction& each : cluster.predictions) {
    const ClusterFrame& frame = each.frame;
    Json entry = {{"objects", each.row->objects},
                  {"deployment", name_of(each.row->deployment)},
                  {"broad_phase", name_of(each.row->placement)},
                  {"nodes", each.nodes},
                  {"extrapolated", each.extrapolated},
                  {"modelled_frame_ms", frame.total()},
                  {"modelled_frame_if_even_ms", each.even_ms},
                  {"parts_ms",
                   {{"move", frame.move},
                    {"states", frame.states},
                    {"sweep", frame.sweep},
                    {"m2", frame.m2},
                    {"narrow", frame.narrow},
                    {"m3", frame.m3},
                    {"m4", frame.m4},
                    {"hops", frame.hops},
                    {"wait", frame.wait}}},
                  {"saturates", each.load.limit()},
                  {"scaling", scaling_json(each.scaling)}};
    if (each.paper != nullptr) entry["paper"] = {{"relation", each.paper->relation}, {"frame_ms", each.paper->ms}};
    json["frames"].push_back(std::move(entry));
  }
  return json;
}

}  // namespace

void print_scale(std::FILE* out, const ScaleOptions& options, const ScaleResult& result) {
  print_head(out, options, result);
  print_rows(out, result.rows);
  for (const ClusterResult& cluster : result.clusters) print_cluster(out, cluster);
  if (result.ended_by != nullptr) {
    fmt::print(out, "ended by {}: the table has the runs that were complete, without models and plots\n",
               result.ended_by);
  }
}

void write_scale_json(OutputFile& out, const ScaleOptions& options, const ScaleResult& result) {
  const RunOptions& base = options.base;
  Json json;
  json["config"] = {{"shapes", name_of(base.world.shapes)},
                    {"coverage", base.world.coverage},
                    {"seed", base.world.seed},
                    {"users", base.service.users},
                    {"user_threads", base.service.user_threads},
                    {"repeats", options.repeats},
                    {"frames", base.frames.frames},
                    {"warmup", base.frames.warmup}};
  json["machine"] = machine_json();
  json["ended_by"] = result.ended_by ? Json(result.ended_by) : Json(nullptr);
  json["empty_frame_messages_ms"] = result.hops_ms;
  json["measures"] = measures_json();
  json["runs"] = Json::array();
  for (const ScaleRow& row : result.rows) json["runs"].push_back(row_json(row));
  json["models"] = Json::array();
  for (const ClusterResult& cluster : result.clusters) json["models"].push_back(cluster_json(cluster));
  out.print("{}\n", json.dump(1, ' '));
}

void write_scale_csv(OutputFile& out, const ScaleResult& result) {
  out.print(
      "objects,deployment,broad_phase,nodes,runs,wall_ms,wall_min_ms,wall_max_ms,server_cpu_ms,busiest_node_cpu_ms,"
      "busiest_user_thread_cpu_ms,modelled_ms,modelled_min_ms,modelled_max_ms,cores_suffice,imbalance,"
      "modelled_speedup,modelled_efficiency,modelled_serial_fraction,wall_speedup,candidates,contacts,digest,"
      "undisturbed_ms,undisturbed_speedup,undisturbed_serial_fraction\n");
  for (const ScaleRow& row : result.rows) {
    const auto scaled = [](const Scaling& scaling, double value) {
      return scaling.known ? fmt::format("{}", value) : std::string();
    };
    out.print("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:016x},{},{},{}\n", row.objects,
              name_of(row.deployment), name_of(row.placement), row.nodes, row.samples.size(), row.wall.median,
              row.wall.min, row.wall.max, row.server.median, row.node.median, row.users.median, row.modelled.median,
              row.modelled.min, row.modelled.max, row.cores_suffice ? 1 : 0, row.imbalance,
              scaled(row.modelled_scaling, row.modelled_scaling.speedup),
              scaled(row.modelled_scaling, row.modelled_scaling.efficiency),
              scaled(row.modelled_scaling, row.modelled_scaling.serial_fraction),
              scaled(row.wall_scaling, row.wall_scaling.speedup), row.counts().tested, row.counts().contacts,
              row.digest(), row.undisturbed.median, scaled(row.undisturbed_scaling, row.undisturbed_scaling.speedup),
              scaled(row.undisturbed_scaling, row.undisturbed_scaling.serial_fraction));
  }
}

}  // namespace ringfence::tools
