#include "report.hpp"

#include <algorithm>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "frozen_names.hpp"
#include "machine.hpp"
#include "profile.hpp"
#include "queries/query_report.hpp"

namespace ringfence::tools {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::size_t max_nodes_shown = 32;

std::string upper(std::string text) {
  if (text.front() == 'm') text.front() = 'M';
  return text;
}

std::string with_spaces(std::string text) {
  for (char& c : text) c = c == '_' ? ' ' : c;
  return text;
}

std::string service_of(const ServiceOptions& service, const Figures& figures) {
  if (service.nodes == 0) {
    return fmt::format("{}, everything in one thread, {} users, broad phase: {}", name_of(service.deployment),
                       service.users, placement_of(service, figures));
  }
  return fmt::format("{}, {} CD node{}, {} users in {} thread{}, broad phase: {}", name_of(service.deployment),
                     service.nodes, service.nodes == 1 ? "" : "s", service.users, service.user_threads,
                     service.user_threads == 1 ? "" : "s", placement_of(service, figures));
}

void print_stages(std::FILE* out, const Figures& figures, double frame_ms) {
  fmt::print(out, "stage               ms    share\n");
  for (std::size_t i = 0; i < stage_count; ++i) {
    const auto stage = static_cast<Stage>(i);
    const double ms = figures.stage_ms(stage);
    fmt::print(out, "  {:<12} {:>8.3f}  {:>5.1f} %\n", with_spaces(name_of(stage)), ms,
               frame_ms > 0 ? 100 * ms / frame_ms : 0.0);
  }
}

void print_nodes(std::FILE* out, const Figures& figures) {
  const std::vector<NodeFigures> nodes = figures.nodes();
  fmt::print(out, "node     busy ms   cpu ms  wait ms   tested   share   hosted\n");
  double all_tested = 0;
  for (const NodeFigures& node : nodes) all_tested += node.tested;
  for (std::size_t i = 0; i < std::min(nodes.size(), max_nodes_shown); ++i) {
    const NodeFigures& node = nodes[i];
    fmt::print(out, "  {:<5} {:>8.3f} {:>8.3f} {:>8.3f} {:>8.0f} {:>5.1f} % {:>8.0f}\n", node.id, node.busy_ms,
               node.cpu_ms, node.wait_ms, node.tested, all_tested > 0 ? 100 * node.tested / all_tested : 0.0,
               node.hosted);
  }
  if (nodes.size() > max_nodes_shown) {
    fmt::print(out, "  {} more in the JSON report (--json FILE)\n", nodes.size() - max_nodes_shown);
  }
}

void print_traffic(std::FILE* out, const Figures& figures) {
  fmt::print(out, "messages per frame  bytes per frame\n");
  for (std::size_t i = 0; i < traffic_count; ++i) {
    const TrafficReport traffic = figures.traffic(static_cast<Traffic>(i));
    if (traffic.messages == 0 && traffic.bytes == 0) continue;
    fmt::print(out, "  {:<8} {:>7.1f} {:>16.0f}\n", upper(name_of_traffic(static_cast<Traffic>(i))),
               figures.mean(static_cast<double>(traffic.messages)), figures.mean(static_cast<double>(traffic.bytes)));
  }
}

void print_unlisted(std::FILE* out, const Figures& figures) {
  if (figures.totals.unlisted == 0) return;
  fmt::print(out, "unlisted    {:.1f} per frame, {} in total\n",
             figures.mean(static_cast<double>(figures.totals.unlisted)), figures.totals.unlisted);
}

void print_failed_supports(std::FILE* out, const Figures& figures) {
  if (figures.totals.failed_supports == 0) return;
  fmt::print(out, "supports    a support function failed in {} pairs, which have no contact\n",
             figures.totals.failed_supports);
}

void print_check(std::FILE* out, const FrameChecker& checker) {
  if (checker.miscounted() > 0) {
    fmt::print(out, "counters    FAILED: in {} frames not every candidate was tested and accepted exactly once\n",
               checker.miscounted());
  }
  if (!checker.brute_force()) return;
  if (checker.differences() == 0) {
    fmt::print(out, "check       {} frames agree with brute force in double precision\n", checker.frames());
    if (checker.answers() > 0) {
      fmt::print(out, "check       {} answers of {} frames agree with brute force in double precision\n",
                 checker.answers(), checker.answered_frames());
    }
  } else {
    fmt::print(out, "check       FAILED: {} differences from brute force in {} frames\n", checker.differences(),
               checker.frames());
  }
}

/// What the report calls contacts: the label of the scene, if it has one.
std::string contact_label(const Job& job) {
  return job.scene.contact_label.empty() ? "contacts" : job.scene.contact_label;
}

Json config_of(const Job& job, const Figures& figures) {
  Json config = {{"deployment", name_of(job.service.deployment)},
                 {"broad_phase", name_of(figures.placement)},
                 {keys::requested_broad_phase, name_of(job.service.placement)},
                 {"nodes", job.service.nodes},
                 {"users", job.service.users},
                 {"user_threads", job.service.user_threads},
                 {"interest", job.service.interest},
                 {"ring_bytes", job.service.ring_bytes},
                 {"pin", job.service.pin},
                 {"balance", job.service.balance},
                 {"balance_by", name_of(job.service.balance_by)},
                 {"keep_resting", job.service.keep_resting},
                 {"link", name_of(job.service.link.kind)},
                 {"lease_ms", job.service.link.network.lease_ms},
                 {"warmup", job.frames.warmup},
                 {"frames", job.frames.frames},
                 {"objects", job.objects}};
  if (job.service.history > 0) config["history"] = job.service.history;
  if (job.service.deepest_contacts > 0) config["deepest_contacts"] = job.service.deepest_contacts;
  if (job.queries.rays > 0) config["rays"] = job.queries.rays;
  if (const worlds::PaperWorldOptions* world = job.world) {
    config["shapes"] = name_of(world->shapes);
    config["coverage"] = world->coverage;
    config["seed"] = world->seed;
    config["targets"] = world->targets != 0 ? world->targets : std::max(1u, world->objects / 50);
    config["target_interval"] = {world->target_interval.min, world->target_interval.max};
    config["retarget_interval"] = {world->retarget_interval.min, world->retarget_interval.max};
  }
  return config;
}

void print_imbalance(std::FILE* out, const Figures& figures) {
  const Imbalance& cpu = figures.cpu_imbalance;
  if (cpu.windows() == 0 || figures.nodes().size() < 2) return;
  fmt::print(out,
             "imbalance   busiest node over mean in {} windows of {} frames: CPU time {:.3f}, at most {:.3f}; pairs "
             "tested {:.3f}, at most {:.3f}; region map changed {} times\n",
             cpu.windows(), Imbalance::window, cpu.mean(), cpu.max(), figures.tested_imbalance.mean(),
             figures.tested_imbalance.max(), figures.map_changes);
}

Json imbalance_of(const Figures& figures) {
  const auto spread = [](const Imbalance& imbalance) {
    return Json{{"mean", imbalance.mean()}, {"max", imbalance.max()}, {"windows", imbalance.windows()}};
  };
  return {{"window", Imbalance::window},
          {"cpu", spread(figures.cpu_imbalance)},
          {"tested", spread(figures.tested_imbalance)},
          {"map_changes", figures.map_changes}};
}

void print_losses(std::FILE* out, const Figures& figures) {
  for (const Figures::Loss& loss : figures.losses) {
    fmt::print(out, "lost        frame {}: {} node {}; the frame took {:.3f} ms\n", loss.frame,
               loss.user ? "user" : "CD", loss.node, loss.frame_ms);
  }
}

void print_cluster(std::FILE* out, const dds::ClusterReport& cluster) {
  fmt::print(out, "cluster     {} joined, {} left, {} lost, {} refused; {} stale parcels\n", cluster.joined,
             cluster.left, cluster.lost, cluster.refused, cluster.stale_parcels);
  fmt::print(out, "process                      sent MB   recv MB  resent MB   answer ms      max\n");
  for (std::size_t i = 0; i < std::min(cluster.members.size(), max_nodes_shown); ++i) {
    const dds::MemberReport& member = cluster.members[i];
    const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) * 1e-6; };
    fmt::print(out, "  {:<4}{:<21} {:>8.2f} {:>9.2f} {:>10.2f} {:>11.3f} {:>8.3f}\n", member.node.number(), member.name,
               mb(member.sent_bytes), mb(member.received_bytes), mb(member.retransmitted_bytes), member.answer_ms_mean,
               member.answer_ms_max);
  }
}

Json losses_of(const Figures& figures) {
  Json losses = Json::array();
  for (const Figures::Loss& loss : figures.losses) {
    losses.push_back(
        {{"frame", loss.frame}, {"kind", loss.user ? "user" : "cd"}, {"node", loss.node}, {"frame_ms", loss.frame_ms}});
  }
  return losses;
}

void print_resizes(std::FILE* out, const Job& job, const ResizeSchedule& resize_schedule) {
  for (const ResizeFigures& resize : resize_schedule.figures()) {
    fmt::print(
        out,
        "resize      frame {}: {} to {} nodes, {} objects handed over; frame {:.3f} ms, next {:.3f}, before {:.3f}, "
        "after {:.3f}; {} {:.0f}, next {:.0f}, before {:.1f}\n",
        resize.frame, resize.from, resize.to, resize.handed_over, resize.frame_ms.at, resize.frame_ms.next,
        resize.frame_ms.before, resize.frame_ms.after, contact_label(job), resize.contacts.at, resize.contacts.next,
        resize.contacts.before);
  }
}

Json resizes_of(const ResizeSchedule& resize_schedule) {
  const auto around = [](const ResizeFigures::Around& a) {
    return Json{{"before", a.before}, {"at", a.at}, {"next", a.next}, {"after", a.after}};
  };
  Json resizes = Json::array();
  for (const ResizeFigures& resize : resize_schedule.figures()) {
    resizes.push_back({{"frame", resize.frame},
                       {"from", resize.from},
                       {"to", resize.to},
                       {"handed_over", resize.handed_over},
                       {"frame_ms", around(resize.frame_ms)},
                       {"contacts", around(resize.contacts)}});
  }
  return resizes;
}

Json nodes_of(const Figures& figures) {
  Json nodes = Json::array();
  for (const NodeFigures& node : figures.nodes()) {
    nodes.push_back({{"id", node.id},
                     {"busy_ms", node.busy_ms},
                     {"cpu_ms", node.cpu_ms},
                     {"wait_ms", node.wait_ms},
                     {"tested", node.tested},
                     {"carried", node.carried},
                     {"move_ms", node.move_ms},
                     {"broad_phase_ms", node.broad_phase_ms},
                     {"narrow_phase_ms", node.narrow_phase_ms},
                     {"candidates", node.candidates},
                     {"contacts", node.contacts},
                     {"hosted", node.hosted},
                     {"handed_over", node.handed_over}});
  }
  return nodes;
}

Json kinds_of(const Figures& figures) {
  Json kinds = Json::array();
  for (const KindReport& kind : figures.kinds()) {
    kinds.push_back({{"first", name_of(kind.first)},
                     {"second", name_of(kind.second)},
                     {"candidates", kind.candidates},
                     {"hits", kind.hits},
                     {"lanes", kind.lanes},
                     {"lanes_filled", kind.lanes_filled},
                     {"iterations", kind.iterations},
                     {"ended_early", kind.ended_early},
                     {"timed", kind.timed},
                     {"nanoseconds", kind.nanoseconds},
                     {"gather_nanoseconds", kind.gather_nanoseconds},
                     {"cost", kind.cost}});
  }
  return kinds;
}

Json report_of(const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
               const FrameChecker& checker) {
  const Spread frame = figures.frame_ms();
  Json report;
  report["config"] = config_of(job, figures);
  report["machine"] = machine_json();
  report["frames"] = figures.frames();
  report["ended_by"] = figures.ended_by ? Json(figures.ended_by) : Json(nullptr);
  report["digest"] = fmt::format("{:016x}", figures.digest());
  if (figures.queries) report["answer_digest"] = answer_digest(figures);
  report["frame_ms"] = {{"mean", frame.mean}, {"p50", frame.p50}, {"p99", frame.p99}, {"max", frame.max}};
  for (std::size_t i = 0; i < stage_count; ++i) {
    report["stages_ms"][name_of(static_cast<Stage>(i))] = figures.stage_ms(static_cast<Stage>(i));
  }
  report["pairs"] = {{"candidate", figures.candidates},
                     {"tested", figures.tested},
                     {"carried", figures.carried},
                     {"accepted", figures.accepted}};
  report["contacts"] = {{"label", contact_label(job)},
                        {"total", figures.contacts},
                        {"mean", figures.mean(static_cast<double>(figures.contacts))},
                        {"began", figures.began},
                        {"ended", figures.ended}};
  if (figures.queries) report["queries"] = queries_json(figures);
  report["nodes"] = nodes_of(figures);
  report["kinds"] = kinds_of(figures);
  report["imbalance"] = imbalance_of(figures);
  report["lost"] = losses_of(figures);
  if (figures.cluster) report["cluster"] = cluster_json(*figures.cluster);
  if (!job.service.resizes.empty()) report["resizes"] = resizes_of(resize_schedule);
  for (std::size_t i = 0; i < traffic_count; ++i) {
    const TrafficReport traffic = figures.traffic(static_cast<Traffic>(i));
    report["traffic"][name_of_traffic(static_cast<Traffic>(i))] = {
        {"messages", traffic.messages}, {"records", traffic.records}, {"bytes", traffic.bytes}};
  }
  for (const auto& [name, counter] : FrameReport::counters()) report[name] = figures.totals.*counter;
  report["server_cpu_ms"] = figures.mean(figures.server_cpu_ms);
  report["users_cpu_ms"] = figures.mean(figures.users_cpu_ms);
  if (job.service.nodes > 0) {
    for (const PathReport::Step& step : PathReport::all()) {
      report["path_ms"][path_key(step)] = figures.mean(figures.path.*step.second);
    }
    report["path_ms"]["critical"] = figures.mean(figures.critical_ms);
  }
  report["refused"] = Json::object();
  for (std::size_t i = 0; i < status_count; ++i) {
    const auto reason = static_cast<Status>(i);
    if (figures.refused(reason) > 0) report["refused"][name_of(reason)] = figures.refused(reason);
  }
  if (checker.brute_force()) {
    report["check"] = {{"frames", checker.frames()}, {"differences", checker.differences()}};
    if (figures.queries) report["check"]["answers"] = checker.answers();
  }
  if (job.profile) report["profile"] = profile_json(figures);
  return report;
}

}  // namespace

Json change_json(const dds::MemberChange& change) {
  switch (change.kind) {
    case dds::MemberChange::Kind::joined:
      return {{"what", "joined"},
              {"name", change.name},
              {"at", change.at},
              {keys::waiting_ms, change.before_ms},
              {keys::first_parcel_ms, change.after_ms}};
    case dds::MemberChange::Kind::left:
      return {{"what", "left"}, {"name", change.name}, {"at", change.at}, {keys::leave_request_ms, change.before_ms}};
    case dds::MemberChange::Kind::lost:
      break;
  }
  return {{"what", "lost"},
          {"name", change.name},
          {"at", change.at},
          {"silent_ms", change.before_ms},
          {"complete_ms", change.after_ms}};
}

Json cluster_json(const dds::ClusterReport& cluster) {
  Json members = Json::array();
  Json changes = Json::array();
  for (const dds::MemberChange& change : cluster.changes) changes.push_back(change_json(change));
  for (const dds::MemberReport& member : cluster.members) {
    members.push_back({{"name", member.name},
                       {"number", member.node.number()},
                       {"sent_parcels", member.sent_parcels},
                       {"sent_bytes", member.sent_bytes},
                       {keys::received_parcels, member.received_parcels},
                       {keys::received_bytes, member.received_bytes},
                       {"shared_bytes", member.shared_bytes},
                       {"retransmitted_bytes", member.retransmitted_bytes},
                       {"refused_writes", member.refused_writes},
                       {"answers", member.answers},
                       {"answer_ms_mean", member.answer_ms_mean},
                       {"answer_ms_max", member.answer_ms_max}});
  }
  return {{"joined", cluster.joined},
          {"left", cluster.left},
          {"lost", cluster.lost},
          {"refused", cluster.refused},
          {"stale_parcels", cluster.stale_parcels},
          {"changes", changes},
          {"members", members}};
}

Json machine_json() {
  const Machine machine = this_machine();
  return {{"cpu", machine.cpu},       {"cores", machine.cores},       {"usable_cores", machine.usable_cores},
          {"system", machine.system}, {"compiler", machine.compiler}, {"build", machine.build}};
}

std::string placement_of(const ServiceOptions& service, const Figures& figures) {
  std::string requested = name_of(service.placement);
  if (service.placement == figures.placement) return requested;
  return fmt::format("{} ({})", requested, name_of(figures.placement));
}

std::string counted_frames(const Job& job, const Figures& figures) {
  if (figures.ended_by == nullptr) {
    return fmt::format("{} frames counted after {} of warm-up", figures.frames(), job.frames.warmup);
  }
  if (figures.frames() == 0) return fmt::format("no frame counted: ended by {} before the first", figures.ended_by);
  return fmt::format("{} of {} frames counted after {} of warm-up: ended by {}", figures.frames(), job.frames.frames,
                     job.frames.warmup, figures.ended_by);
}

void print_report(std::FILE* out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                  const FrameChecker& checker) {
  const Spread frame = figures.frame_ms();
  fmt::print(out, "{}\n{}\n", job.title, service_of(job.service, figures));
  fmt::print(out, "{}\n\n", counted_frames(job, figures));
  fmt::print(out, "frame       mean {:.3f} ms   p50 {:.3f}   p99 {:.3f}   max {:.3f}\n", frame.mean, frame.p50,
             frame.p99, frame.max);
  print_stages(out, figures, frame.mean);
  const std::string carried =
      figures.carried > 0 ? fmt::format(", {:.1f} carried over", figures.mean(static_cast<double>(figures.carried)))
                          : "";
  fmt::print(out, "pairs       {:.1f} candidates per frame, {:.1f} tested{}; {} in total\n",
             figures.mean(static_cast<double>(figures.candidates)), figures.mean(static_cast<double>(figures.tested)),
             carried, figures.tested + figures.carried);
  fmt::print(out, "{:<11} {:.1f} per frame, {} in total\n", contact_label(job),
             figures.mean(static_cast<double>(figures.contacts)), figures.contacts);
  print_unlisted(out, figures);
  fmt::print(out, "moved       {:.1f} objects per frame, {:.2f} handed over\n",
             figures.mean(static_cast<double>(figures.totals.moved)),
             figures.mean(static_cast<double>(figures.totals.handed_over)));
  print_nodes(out, figures);
  print_imbalance(out, figures);
  print_resizes(out, job, resize_schedule);
  print_losses(out, figures);
  if (figures.cluster) print_cluster(out, *figures.cluster);
  print_traffic(out, figures);
  for (std::size_t i = 1; i < status_count; ++i) {
    const auto reason = static_cast<Status>(i);
    if (figures.refused(reason) > 0) fmt::print(out, "refused     {} {}\n", figures.refused(reason), name_of(reason));
  }
  print_failed_supports(out, figures);
  print_queries(out, figures);
  print_check(out, checker);
  if (!job.record_prefix.empty()) fmt::print(out, "recorded    {0}.json, {0}.bin\n", job.record_prefix);
  fmt::print(out, "digest      {:016x}\n", figures.digest());
}

void write_json_report(OutputFile& out, const Job& job, const Figures& figures, const ResizeSchedule& resize_schedule,
                       const FrameChecker& checker) {
  out.print("{}\n", report_of(job, figures, resize_schedule, checker).dump(1, ' '));
}

}  // namespace ringfence::tools
