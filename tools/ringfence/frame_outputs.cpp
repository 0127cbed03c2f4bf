#include "frame_outputs.hpp"

#include <algorithm>
#include <string>

namespace ringfence::tools {
namespace {

// Track numbers determine the order in the viewer. Nodes come by id, so a node keeps its track.
constexpr std::uint32_t first_user_track = 10'000, frame_track = 1'000'000;

std::unique_ptr<OutputFile> open(const std::string& path) {
  return path.empty() ? nullptr : std::make_unique<OutputFile>(path);
}

double microseconds(std::uint64_t ns) { return static_cast<double>(ns) * 1e-3; }

}  // namespace

FrameOutputs::FrameOutputs(const OutputOptions& options)
    : collisions_(open(options.collisions)), frames_(open(options.frames_csv)), trace_(open(options.trace)) {
  if (collisions_) collisions_->print("frame,a,b,px,py,pz,nx,ny,nz,depth\n");
  if (frames_) {
    frames_->print("frame,frame_ms");
    for (std::size_t i = 0; i < stage_count; ++i) frames_->print(",{}_ms", name_of(static_cast<Stage>(i)));
    frames_->print(",candidates,tested,accepted,contacts,began,ended,objects,moved,handed_over,grown");
    frames_->print(",m1_bytes,m2_bytes,m3_bytes,m4_bytes,m5_bytes,state_bytes,control_bytes,server_cpu_ms,");
    frames_->print("users_cpu_ms,busiest_node_ms\n");
  }
  if (trace_) trace_->print("{{\"displayTimeUnit\": \"ms\", \"traceEvents\": [");
}

void FrameOutputs::add_frame(std::uint64_t frame, const World& world) {
  if (collisions_) add_contacts(frame, world.contacts());
  if (frames_) add_row(frame, world.report());
  if (trace_) add_spans(frame, world);
}

// {} formats the shortest text that reads back as the same float or double.
void FrameOutputs::add_contacts(std::uint64_t frame, std::span<const Contact> contacts) {
  for (const Contact& c : contacts) {
    collisions_->print("{},{},{},{},{},{},{},{},{},{}\n", frame, c.a, c.b, c.point.x, c.point.y, c.point.z, c.normal.x,
                       c.normal.y, c.normal.z, c.depth);
  }
}

void FrameOutputs::add_row(std::uint64_t frame, const FrameReport& report) {
  frames_->print("{},{}", frame, report.frame_ms);
  for (const double ms : report.stage_ms) frames_->print(",{}", ms);
  for (const std::uint64_t count : {report.candidates, report.tested, report.accepted, report.contacts, report.began,
                                    report.ended, report.objects, report.moved, report.handed_over, report.grown}) {
    frames_->print(",{}", count);
  }
  for (const TrafficReport& traffic : report.traffic) frames_->print(",{}", traffic.bytes);
  double busiest = 0;
  for (const NodeReport& node : report.nodes) busiest = std::max(busiest, node.busy_ms);
  frames_->print(",{},{},{}\n", report.server_cpu_ms, report.users_cpu_ms, busiest);
}

void FrameOutputs::add_spans(std::uint64_t frame, const World& world) {
  const auto& spans = world.report().timeline;
  if (spans.empty()) return;
  const auto event = [this] {
    trace_->print("{}", first_span_ ? "\n" : ",\n");
    first_span_ = false;
  };
  const auto name_track = [&](std::uint32_t track, const std::string& name) {
    event();
    trace_->print(R"({{"ph": "M", "name": "thread_name", "pid": 1, "tid": {}, "args": {{"name": "{}"}}}})", track,
                  name);
  };
  const auto add = [&](std::uint32_t track, const std::string& name, std::uint64_t begin, std::uint64_t end) {
    event();
    trace_->print(R"({{"ph": "X", "name": "{}", "pid": 1, "tid": {}, "ts": {:.3f}, "dur": {:.3f}}})", name, track,
                  microseconds(begin - epoch_ns_), microseconds(end - begin));
  };

  std::uint64_t begin = spans.front().begin_ns, end = 0;
  for (const TimelineSpan& span : spans) {
    begin = std::min(begin, span.begin_ns);
    end = std::max(end, span.end_ns);
  }
  if (!tracks_named_) {
    tracks_named_ = true;
    epoch_ns_ = begin;
    const bool threaded = world.config().nodes != 0;
    name_track(frame_track, "frames");
    name_track(0, threaded ? "server" : "server, node and users");
    for (std::uint32_t thread = 0; threaded && thread < world.config().user_threads; ++thread) {
      name_track(first_user_track + thread, fmt::format("users {}", thread));
    }
  }
  const std::vector<NodeReport>& nodes = world.report().nodes;
  for (const NodeReport& node : nodes) {
    if (node.id.number() >= nodes_named_) name_track(1 + node.id.number(), fmt::format("node {}", node.id.number()));
  }
  for (const NodeReport& node : nodes) nodes_named_ = std::max(nodes_named_, node.id.number() + 1);
  add(frame_track, fmt::format("frame {}", frame), begin, end);
  const auto count = static_cast<std::uint32_t>(nodes.size());
  for (const TimelineSpan& span : spans) {
    const std::uint32_t position = span.track - 1;  // among the nodes, then among the user threads
    const std::uint32_t track = span.track == 0    ? 0
                                : position < count ? 1 + nodes[position].id.number()
                                                   : first_user_track + position - count;
    add(track, span.name, span.begin_ns, span.end_ns);
  }
}

void FrameOutputs::finish() {
  if (collisions_) collisions_->close();
  if (frames_) frames_->close();
  if (trace_) {
    trace_->print("\n]}}\n");
    trace_->close();
  }
}

}  // namespace ringfence::tools
