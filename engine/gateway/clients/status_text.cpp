#include "gateway/clients/status_text.hpp"

#include <algorithm>
#include <array>

#include <nlohmann/json.hpp>

namespace ringfence::gateway {
namespace {

using Json = nlohmann::json;

constexpr int map_side = 64;

/// The owner of the centre of each cell of a grid over the world, at its middle height.
Json region_map(const World& world) {
  const Vec3d &low = world.config().bounds_min, &high = world.config().bounds_max;
  Json nodes = Json::array();
  for (int row = 0; row < map_side; ++row) {
    for (int column = 0; column < map_side; ++column) {
      const Vec3d centre{low.x + (high.x - low.x) * (column + 0.5) / map_side,
                         low.y + (high.y - low.y) * (row + 0.5) / map_side, (low.z + high.z) / 2};
      const std::optional<NodeId> node = world.node_at(centre);
      nodes.push_back(node ? Json(node->number()) : Json(nullptr));
    }
  }
  return {{"columns", map_side},
          {"rows", map_side},
          {"min", {low.x, low.y}},
          {"max", {high.x, high.y}},
          {"nodes", std::move(nodes)}};
}

template <class Byte>
std::string hexadecimal(std::span<const Byte> bytes) {
  constexpr const char* digits = "0123456789abcdef";
  std::string text;
  for (const Byte byte : bytes) {
    const auto value = static_cast<unsigned>(byte);
    text += digits[value >> 4];
    text += digits[value & 15];
  }
  return text;
}

std::string hexadecimal(std::uint64_t value) {
  std::array<std::uint8_t, 8> bytes{};
  for (int i = 7; i >= 0; --i, value >>= 8) bytes[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(value);
  return hexadecimal(std::span<const std::uint8_t>(bytes));
}

}  // namespace

StatusText::NodeLoad& StatusText::load_of(NodeId id) {
  const auto found = std::ranges::find(loads_, id, &NodeLoad::id);
  if (found != loads_.end()) return *found;
  NodeLoad& load = loads_.emplace_back();
  load.id = id;
  return load;
}

void StatusText::add_frame() {
  const FrameReport& report = world_.report();
  for (const NodeReport& node : report.nodes) {
    NodeLoad& load = load_of(node.id);
    ++load.frames;
    load.busy_ms += node.busy_ms;
    load.pairs += node.tested;
    load.contacts += node.contacts;
    load.hosted += node.hosted;
  }
  lost_.insert(lost_.end(), report.lost.begin(), report.lost.end());
}

void StatusText::restart() {
  loads_.clear();
  lost_.clear();
}

std::string StatusText::text(std::size_t clients, std::optional<std::uint64_t> digest, bool has_map) const {
  const FrameReport& report = world_.report();
  Json nodes = Json::array();
  for (const NodeReport& node : report.nodes) {
    const auto load = std::ranges::find(loads_, node.id, &NodeLoad::id);
    if (load == loads_.end()) continue;
    const auto frames = static_cast<double>(load->frames);
    nodes.push_back({{"id", node.id.number()},
                     {"busy_ms", load->busy_ms / frames},
                     {"pairs", static_cast<double>(load->pairs) / frames},
                     {"contacts", static_cast<double>(load->contacts) / frames},
                     {"hosted", static_cast<double>(load->hosted) / frames}});
  }
  Json lost = Json::array();
  for (const NodeId id : lost_) lost.push_back(id.number());
  Json status{{"frame", report.frame},     {"frame_ms", report.frame_ms}, {"objects", report.objects},
              {"clients", clients},        {"pairs", report.candidates},  {"contacts", report.contacts},
              {"nodes", std::move(nodes)}, {"lost", std::move(lost)}};
  if (!contact_label_.empty()) status["contact_label"] = contact_label_;
  if (digest) status["digest"] = hexadecimal(*digest);
  if (!has_map) status["regions"] = region_map(world_);
  return status.dump();
}

std::string described_text(const World& world, ObjectNumber number) {
  Json json{{"number", number}};
  const ObjectView object = world.object(world.find(number));
  if (!object.id) return json.dump();
  const ObjectSpec& spec = object.spec;
  const Pose& pose = spec.pose;
  json["generation"] = object.id.generation();
  json["category"] = name_of(spec.category);
  json["shape"] = spec.shape.number();
  json["layer"] = spec.layer;
  json["group"] = spec.group;
  json["user"] = spec.user ? Json(spec.user.number()) : Json(nullptr);
  json["user_data"] = spec.user_data;
  const std::optional<NodeId> node = world.node_at(pose.position);
  json["node"] = node ? Json(node->number()) : Json(nullptr);
  json["position"] = {pose.position.x, pose.position.y, pose.position.z};
  json["orientation"] = {pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w};
  json["state"] = hexadecimal(world.state(object.id));
  Json contacts = Json::array();
  for (const Contact& contact : world.collisions_of(object.id)) {
    contacts.push_back(contact.a == number ? contact.b : contact.a);
  }
  json["contacts"] = std::move(contacts);
  return json.dump();
}

}  // namespace ringfence::gateway
