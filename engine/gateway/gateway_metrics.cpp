#include "gateway/gateway_metrics.hpp"

#include <array>
#include <cstdio>

namespace ringfence::gateway {
namespace {

class MetricsText {
 public:
  void add(const char* name, const char* type, const char* help, double value) {
    begin(name, type, help);
    text_ += std::string(name) + " " + number(value) + "\n";
  }
  void begin(const char* name, const char* type, const char* help) {
    text_ += std::string("# HELP ") + name + " " + help + "\n# TYPE " + name + " " + type + "\n";
  }
  void add_labelled(const char* name, const char* label, const std::string& label_value, double value) {
    text_ += std::string(name) + "{" + label + "=\"" + label_value + "\"} " + number(value) + "\n";
  }
  std::string take() { return std::move(text_); }

 private:
  static std::string number(double value) {
    std::array<char, 32> text{};
    const int size = std::snprintf(text.data(), text.size(), "%.9g", value);
    return {text.data(), static_cast<std::size_t>(size)};
  }
  std::string text_;
};

}  // namespace

std::string metrics_text(const World& world) {
  const FrameReport& frame = world.report();
  MetricsText text;
  text.add("ringfence_frames_total", "counter", "Complete frames.", static_cast<double>(world.frames()));
  text.add("ringfence_frame_seconds", "gauge", "Duration of the last frame.", frame.frame_ms * 1e-3);
  text.add("ringfence_objects", "gauge", "Live objects.", static_cast<double>(frame.objects));
  text.add("ringfence_pairs", "gauge", "Candidate pairs of the last frame.", static_cast<double>(frame.candidates));
  text.add("ringfence_contacts", "gauge", "Contacts of the last frame.", static_cast<double>(frame.contacts));
  text.add("ringfence_nodes", "gauge", "CD nodes.", static_cast<double>(frame.nodes.size()));
  text.begin("ringfence_node_busy_seconds", "gauge", "Work of each CD node in the last frame.");
  for (const NodeReport& node : frame.nodes) {
    text.add_labelled("ringfence_node_busy_seconds", "node", std::to_string(node.id.number()), node.busy_ms * 1e-3);
  }
  return text.take();
}

std::string metrics_text(const World& world, const GatewayReport& report) {
  MetricsText text;
  text.add("ringfence_gateway_players", "gauge", "Players that are connected.", static_cast<double>(report.players));
  text.add("ringfence_gateway_spectators", "gauge", "Spectators and operators.",
           static_cast<double>(report.spectators));
  text.add("ringfence_gateway_away", "gauge", "Players without a connection whose avatar stays.",
           static_cast<double>(report.away));
  text.add("ringfence_gateway_updates_total", "counter", "Updates made for clients.",
           static_cast<double>(report.updates));
  text.add("ringfence_gateway_frame_cpu_seconds_total", "counter", "CPU time of the gateway on the frames' thread.",
           report.frame_cpu_s);
  text.add("ringfence_gateway_network_cpu_seconds_total", "counter", "CPU time of the gateway's own thread.",
           report.network_cpu_s);
  return metrics_text(world) + text.take();
}

std::string metrics_text(const dds::NodeServiceReport& report) {
  MetricsText text;
  text.add("ringfence_node_serves", "gauge", "1: the node is assigned in a world.", report.serves ? 1 : 0);
  text.add("ringfence_node_frames_total", "counter", "Complete frames.", static_cast<double>(report.frames));
  text.add("ringfence_node_frame_busy_seconds", "gauge", "Work of the node in the last frame.", report.frame_busy_s);
  text.add("ringfence_node_cpu_seconds_total", "counter", "CPU time of the node's frames.", report.cpu_s);
  text.add("ringfence_node_objects", "gauge", "Objects that the node hosts.", static_cast<double>(report.objects));
  text.add("ringfence_node_handed_over_total", "counter", "Objects that the node has handed over to other nodes.",
           static_cast<double>(report.handed_over));
  return text.take();
}

}  // namespace ringfence::gateway
