#include "frame_outputs.hpp"

#include <algorithm>
#include <string>

namespace ringfence::tools {
namespace {

std::unique_ptr<OutputFile> open(const std::string& path) {
  return path.empty() ? nullptr : std::make_unique<OutputFile>(path);
}

}  // namespace

FrameOutputs::FrameOutputs(const OutputOptions& options)
    : collisions_(open(options.collisions)),
      frames_(open(options.frames_csv)),
      timeline_(options.trace.empty() ? nullptr : std::make_unique<TimelineFile>(options.trace)) {
  if (collisions_) collisions_->print("frame,a,b,px,py,pz,nx,ny,nz,depth\n");
  if (frames_) {
    frames_->print("frame,frame_ms");
    for (std::size_t i = 0; i < stage_count; ++i) frames_->print(",{}_ms", name_of(static_cast<Stage>(i)));
    frames_->print(",candidates,tested,accepted,contacts,began,ended,objects,moved,handed_over,grown");
    frames_->print(",m1_bytes,m2_bytes,m3_bytes,m4_bytes,m5_bytes,state_bytes,control_bytes,server_cpu_ms,");
    frames_->print("users_cpu_ms,busiest_node_ms,carried,unlisted\n");
  }
}

void FrameOutputs::add_frame(std::uint64_t frame, const World& world) {
  if (collisions_) add_contacts(frame, world.contacts());
  if (frames_) add_row(frame, world.report());
  if (timeline_) timeline_->add_frame(frame, world);
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
  frames_->print(",{},{},{},{},{}\n", report.server_cpu_ms, report.users_cpu_ms, busiest, report.carried,
                 report.unlisted);
}

void FrameOutputs::finish() {
  if (collisions_) collisions_->close();
  if (frames_) frames_->close();
  if (timeline_) timeline_->finish();
}

}  // namespace ringfence::tools
