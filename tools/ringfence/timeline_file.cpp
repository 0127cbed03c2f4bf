#include "timeline_file.hpp"

#include <algorithm>

namespace ringfence::tools {
namespace {

// Viewers sort processes and threads by these numbers.
enum Process : std::uint32_t { frames = 1, server = 2, nodes = 3, users = 4 };

}  // namespace

TimelineFile::TimelineFile(const std::string& path) : file_(path) {
  file_.print("{{\"displayTimeUnit\": \"ms\", \"traceEvents\": [");
}

void TimelineFile::begin_event() {
  file_.print("{}", first_event_ ? "\n" : ",\n");
  first_event_ = false;
}

void TimelineFile::name_process(std::uint32_t process, std::string_view name) {
  begin_event();
  file_.print(R"({{"ph": "M", "name": "process_name", "pid": {}, "args": {{"name": "{}"}}}})", process, name);
  begin_event();
  file_.print(R"({{"ph": "M", "name": "process_sort_index", "pid": {}, "args": {{"sort_index": {}}}}})", process,
              process);
}

void TimelineFile::name_thread(Track track, std::string_view name) {
  begin_event();
  file_.print(R"({{"ph": "M", "name": "thread_name", "pid": {}, "tid": {}, "args": {{"name": "{}"}}}})", track.process,
              track.thread, name);
}

void TimelineFile::add_span(Track track, std::string_view name, std::uint64_t begin_ns, std::uint64_t end_ns) {
  begin_event();
  file_.print(R"({{"ph": "X", "name": "{}", "pid": {}, "tid": {}, "ts": {:.3f}, "dur": {:.3f}}})", name, track.process,
              track.thread, microseconds(begin_ns), static_cast<double>(end_ns - begin_ns) * 1e-3);
}

void TimelineFile::add_counter(std::uint32_t process, std::string_view name, std::uint64_t at_ns, double value) {
  begin_event();
  file_.print(R"({{"ph": "C", "name": "{}", "pid": {}, "ts": {:.3f}, "args": {{"value": {}}}}})", name, process,
              microseconds(at_ns), value);
}

void TimelineFile::name_tracks(const World& world) {
  const bool threaded = world.config().nodes != 0;
  name_process(frames, "frames");
  name_thread({frames, 0}, "frames");
  name_process(server, threaded ? "server" : "server, node and users");
  name_thread({server, 0}, threaded ? "server" : "server, node and users");
  name_process(nodes, "CD nodes");
  if (!threaded) return;
  name_process(users, "users");
  for (std::uint32_t thread = 0; thread < world.config().user_threads; ++thread) {
    name_thread({users, thread}, fmt::format("users {}", thread));
  }
}

// Positions of nodes in the report change when nodes leave; a node keeps its track, which has its id.
TimelineFile::Track TimelineFile::track_of(const TimelineSpan& span, const FrameReport& report) {
  if (span.track == 0) return {server, 0};
  const std::uint32_t position = span.track - 1;  // among the nodes, then among the user threads
  const auto count = static_cast<std::uint32_t>(report.nodes.size());
  if (position < count) return {nodes, report.nodes[position].id.number()};
  return {users, position - count};
}

void TimelineFile::add_frame(std::uint64_t frame, const World& world) {
  const FrameReport& report = world.report();
  if (report.timeline.empty()) return;
  std::uint64_t begin = report.timeline.front().begin_ns, end = 0;
  for (const TimelineSpan& span : report.timeline) {
    begin = std::min(begin, span.begin_ns);
    end = std::max(end, span.end_ns);
  }
  if (!has_epoch_) {
    has_epoch_ = true;
    epoch_ns_ = begin;
    name_tracks(world);
  }
  std::uint32_t named = nodes_named_;
  for (const NodeReport& node : report.nodes) {
    const std::uint32_t id = node.id.number();
    if (id >= nodes_named_) name_thread({nodes, id}, fmt::format("node {}", id));
    named = std::max(named, id + 1);
  }
  nodes_named_ = named;
  add_span({frames, 0}, fmt::format("frame {}", frame), begin, end);
  add_counter(frames, "candidates", begin, static_cast<double>(report.candidates));
  add_counter(frames, "contacts", begin, static_cast<double>(report.contacts));
  for (const NodeReport& node : report.nodes) {
    add_counter(nodes, fmt::format("load of node {}, CPU ms", node.id.number()), begin, node.cpu_ms);
  }
  for (const TimelineSpan& span : report.timeline) {
    add_span(track_of(span, report), span.name, span.begin_ns, span.end_ns);
  }
}

void TimelineFile::finish() {
  file_.print("\n]}}\n");
  file_.close();
}

}  // namespace ringfence::tools
