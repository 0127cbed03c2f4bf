#include "worlds/scene_file.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include "geometry/shape_table.hpp"
#include "worlds/json_document.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::worlds {
namespace {

constexpr std::uint64_t max_users = 65'536;
constexpr std::size_t max_layers = 32;
constexpr std::size_t max_label_bytes = 40;

/// Reads the parts of a scene in dependency order: objects refer to shapes and layers.
class SceneReader {
 public:
  SceneReader(const JsonDocument& document, const std::filesystem::path& folder, const MeshLoader& loader)
      : root_(document), folder_(folder), loader_(loader) {}

  Scene read() {
    root_.expect_object({"format", "version", "contact_label", "bounds", "layers", "shapes", "objects"});
    if (root_.field("format").text() != "ringfence-scene") root_.field("format").fail_unexpected("\"ringfence-scene\"");
    root_.field("version").unsigned_integer(1, 1);
    if (root_.has("contact_label")) read_contact_label(root_.field("contact_label"));
    read_bounds(root_.field("bounds"));
    if (root_.has("layers")) read_layers(root_.field("layers"));
    read_shapes(root_.field("shapes"));
    read_objects(root_.field("objects"));
    return std::move(scene_);
  }

 private:
  /// Control characters are refused, since reports go to terminals.
  void read_contact_label(const JsonValue& label) {
    const std::string text = label.text();
    const bool printable =
        std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    if (text.empty() || text.size() > max_label_bytes || !printable) {
      label.fail_unexpected(fmt::format("1 to {} bytes without control characters", max_label_bytes));
    }
    scene_.contact_label = text;
  }

  void read_bounds(const JsonValue& bounds) {
    bounds.expect_object({"min", "max"});
    const Vec3d low = bounds.field("min").vector(), high = bounds.field("max").vector();
    if (!(low.x <= high.x && low.y <= high.y && low.z <= high.z)) {
      bounds.fail_unexpected("min no greater than max on each axis");
    }
    scene_.bounds_min = low;
    scene_.bounds_max = high;
  }

  std::uint8_t layer_of(const JsonValue& name) const {
    const auto& names = scene_.layers.names;
    const auto found = std::find(names.begin(), names.end(), name.text());
    if (found == names.end()) {
      name.fail_unexpected(names.empty() ? "no layer, because the scene has no \"layers\""
                                         : fmt::format("one of the layers {}", fmt::join(names, ", ")));
    }
    return static_cast<std::uint8_t>(found - names.begin());
  }

  void read_layers(const JsonValue& layers) {
    layers.expect_object({"names", "collide"});
    const JsonValue names = layers.field("names");
    names.expect_array();
    if (names.size() < 1 || names.size() > max_layers) names.fail_unexpected(fmt::format("1 to {} names", max_layers));
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string name = names.item(i).text();
      if (std::find(scene_.layers.names.begin(), scene_.layers.names.end(), name) != scene_.layers.names.end()) {
        names.item(i).fail(fmt::format("\"{}\" occurs twice; expected distinct names", name));
      }
      scene_.layers.names.push_back(name);
    }
    const JsonValue collide = layers.field("collide");
    collide.expect_array();
    for (std::size_t i = 0; i < collide.size(); ++i) {
      const JsonValue pair = collide.item(i);
      if (!pair.raw().is_array() || pair.size() != 2) pair.fail_unexpected("a pair of layers [\"p\", \"q\"]");
      scene_.layers.collide.emplace_back(layer_of(pair.item(0)), layer_of(pair.item(1)));
    }
  }

  ShapeDescription read_hull(const JsonValue& shape) {
    shape.expect_object({"type", "points"});
    const JsonValue points = shape.field("points");
    points.expect_array();
    ConvexHull hull;
    for (std::size_t i = 0; i < points.size(); ++i) hull.points.push_back(points.item(i).vector_float());
    return hull;
  }

  ShapeDescription read_mesh(const JsonValue& shape) {
    shape.expect_object({"type", "file"});
    const JsonValue file = shape.field("file");
    const std::filesystem::path path = folder_ / file.text();
    if (!loader_) file.fail("mesh files are not supported here; expected sphere, box, capsule or convex_hull");
    try {
      return loader_(path);
    } catch (const Error& error) {
      file.fail(error.what());
    }
  }

  ShapeDescription read_shape(const JsonValue& shape) {
    shape.expect_any_object();
    const std::string type = shape.field("type").text();
    if (type == "sphere") {
      shape.expect_object({"type", "radius"});
      return Sphere{shape.field("radius").number_float()};
    }
    if (type == "box") {
      shape.expect_object({"type", "half_extents"});
      return Box{shape.field("half_extents").vector_float()};
    }
    if (type == "capsule") {
      shape.expect_object({"type", "radius", "half_height"});
      return Capsule{shape.field("radius").number_float(), shape.field("half_height").number_float()};
    }
    if (type == "convex_hull") return read_hull(shape);
    if (type == "mesh") return read_mesh(shape);
    shape.field("type").fail_unexpected("sphere, box, capsule, convex_hull or mesh");
  }

  void read_shapes(const JsonValue& shapes) {
    shapes.expect_any_object();
    geometry::ShapeTable table;  // used for its checks only
    for (const auto& member : shapes.raw().items()) {
      const JsonValue value = shapes.field(member.key());
      NamedShape shape{member.key(), read_shape(value), {}};
      if (std::holds_alternative<TriangleMesh>(shape.description)) shape.mesh_file = value.field("file").text();
      try {
        table.add(shape.description);
      } catch (const Error& error) {
        value.fail(error.what());
      }
      shape_numbers_.emplace(shape.name, ShapeId(static_cast<std::uint32_t>(scene_.shapes.size())));
      scene_.shapes.push_back(std::move(shape));
    }
  }

  ShapeId shape_of(const JsonValue& name) const {
    const auto found = shape_numbers_.find(name.text());
    if (found == shape_numbers_.end()) {
      name.fail(fmt::format("unknown shape \"{}\"; expected one of the {} in \"shapes\"", name.text(),
                            shape_numbers_.size()));
    }
    return found->second;
  }

  static Category category_of(const JsonValue& name) {
    for (const Category category : {Category::avatar, Category::active, Category::non_active, Category::fixed}) {
      if (name.text() == name_of(category)) return category;
    }
    name.fail_unexpected("avatar, active, non-active or static");
  }

  ObjectSpec read_object(const JsonValue& object) const {
    object.expect_object({"id", "shape", "category", "user", "layer", "group", "position", "orientation"});
    ObjectSpec spec;
    spec.number = static_cast<ObjectNumber>(object.field("id").unsigned_integer(1, 0xffffffffu));
    spec.shape = shape_of(object.field("shape"));
    spec.category = category_of(object.field("category"));
    if (spec.category == Category::avatar) {
      spec.user = UserId(static_cast<std::uint32_t>(object.field("user").unsigned_integer(0, max_users - 1)));
    } else if (object.has("user")) {
      object.field("user").fail("only an avatar has a user; remove the field or make the object an avatar");
    }
    if (object.has("layer")) spec.layer = layer_of(object.field("layer"));
    if (object.has("group")) {
      spec.group = static_cast<std::uint32_t>(object.field("group").unsigned_integer(0, 0xffffffffu));
    }
    spec.enabled = object.has("position");
    if (spec.enabled) spec.pose.position = object.field("position").vector();
    if (object.has("orientation")) spec.pose.orientation = object.field("orientation").orientation();
    return spec;
  }

  void read_objects(const JsonValue& objects) {
    objects.expect_array();
    std::unordered_set<ObjectNumber> numbers;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const JsonValue object = objects.item(i);
      object.expect_any_object();
      scene_.objects.push_back(read_object(object));
      if (!numbers.insert(scene_.objects.back().number).second) {
        object.field("id").fail(fmt::format("id {} occurs twice; expected distinct ids", scene_.objects.back().number));
      }
    }
  }

  JsonValue root_;
  std::filesystem::path folder_;
  const MeshLoader& loader_;
  Scene scene_;
  std::unordered_map<std::string, ShapeId> shape_numbers_;
};

// Floats are formatted as doubles: the reader parses doubles, and the shortest text of a double restores it exactly.
std::string text_of(double value) { return fmt::format("{}", value); }
std::string text_of(float value) { return fmt::format("{}", static_cast<double>(value)); }
std::string text_of(const Vec3d& v) { return fmt::format("[{},{},{}]", text_of(v.x), text_of(v.y), text_of(v.z)); }
std::string text_of(const Vec3f& v) { return fmt::format("[{},{},{}]", text_of(v.x), text_of(v.y), text_of(v.z)); }
std::string quoted(const std::string& text) { return nlohmann::json(text).dump(); }

struct ShapeText {
  const std::string& mesh_file;
  std::string operator()(const Sphere& s) const {
    return fmt::format(R"({{"type": "sphere", "radius": {}}})", text_of(s.radius));
  }
  std::string operator()(const Box& b) const {
    return fmt::format(R"({{"type": "box", "half_extents": {}}})", text_of(b.half_extents));
  }
  std::string operator()(const Capsule& c) const {
    return fmt::format(R"({{"type": "capsule", "radius": {}, "half_height": {}}})", text_of(c.radius),
                       text_of(c.half_height));
  }
  std::string operator()(const ConvexHull& hull) const {
    std::string points;
    for (const Vec3f& p : hull.points) {
      if (!points.empty()) points += ',';
      points += text_of(p);
    }
    return fmt::format(R"({{"type": "convex_hull", "points": [{}]}})", points);
  }
  std::string operator()(const TriangleMesh&) const {
    return fmt::format(R"({{"type": "mesh", "file": {}}})", quoted(mesh_file));
  }
  std::string operator()(const SupportShape&) const {
    throw Error("a shape that only a support function describes cannot be written to a scene file");
  }
};

std::string text_of(const Scene& scene, const ObjectSpec& object) {
  std::string text = fmt::format(R"({{"id": {}, "shape": {}, "category": "{}")", object.number,
                                 quoted(scene.shapes[object.shape.number()].name), name_of(object.category));
  if (object.category == Category::avatar) text += fmt::format(R"(, "user": {})", object.user.number());
  if (!scene.layers.names.empty()) text += fmt::format(R"(, "layer": {})", quoted(scene.layers.names[object.layer]));
  if (object.group != 0) text += fmt::format(R"(, "group": {})", object.group);
  if (object.enabled) text += fmt::format(R"(, "position": {})", text_of(object.pose.position));
  const Quat& q = object.pose.orientation;
  if (!(q == Quat{})) {
    text += fmt::format(R"(, "orientation": [{},{},{},{}])", text_of(q.x), text_of(q.y), text_of(q.z), text_of(q.w));
  }
  text += '}';
  return text;
}

std::string text_of(const LayerMatrix& layers) {
  nlohmann::json names = layers.names, collide = nlohmann::json::array();
  for (const auto& [p, q] : layers.collide) collide.push_back({layers.names[p], layers.names[q]});
  return fmt::format(R"({{"names": {}, "collide": {}}})", names.dump(), collide.dump());
}

}  // namespace

Scene parse_scene(std::string_view text, const std::string& name, const std::filesystem::path& folder,
                  const MeshLoader& loader) {
  const JsonDocument document(text, name);
  return SceneReader(document, folder, loader).read();
}

Scene read_scene(const std::filesystem::path& file, const MeshLoader& loader) {
  return parse_scene(read_text(file), file.string(), file.parent_path(), loader);
}

std::string format_scene(const Scene& scene) {
  std::string text = "{\"format\": \"ringfence-scene\", \"version\": 1,\n";
  if (!scene.contact_label.empty()) text += fmt::format(" \"contact_label\": {},\n", quoted(scene.contact_label));
  text +=
      fmt::format(" \"bounds\": {{\"min\": {}, \"max\": {}}},\n", text_of(scene.bounds_min), text_of(scene.bounds_max));
  if (!scene.layers.names.empty()) text += fmt::format(" \"layers\": {},\n", text_of(scene.layers));
  text += " \"shapes\": {";
  const char* separator = "\n";
  for (const NamedShape& shape : scene.shapes) {
    text += fmt::format("{}  {}: {}", separator, quoted(shape.name),
                        std::visit(ShapeText{shape.mesh_file}, shape.description));
    separator = ",\n";
  }
  text += "},\n \"objects\": [";
  separator = "\n";
  for (const ObjectSpec& object : scene.objects) {
    text += separator;
    text += "  ";
    text += text_of(scene, object);
    separator = ",\n";
  }
  text += "]}\n";
  return text;
}

void write_scene(const std::filesystem::path& file, const Scene& scene) { write_text(file, format_scene(scene)); }

}  // namespace ringfence::worlds
